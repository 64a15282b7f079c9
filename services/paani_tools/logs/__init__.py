"""`paani logs`: look into recordings, repair them, export them."""
