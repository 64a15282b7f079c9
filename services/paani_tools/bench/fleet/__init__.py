"""`paani bench fleet`: what each vessel of a fleet costs at the shore."""
