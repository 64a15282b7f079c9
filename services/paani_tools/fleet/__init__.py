"""`paani fleet`: many vessels, watched and stopped from the shore."""
