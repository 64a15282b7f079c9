"""`paani sensors`: what each device of a real hull says, and what is missing."""
