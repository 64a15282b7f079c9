"""`paani bench ports`: what the ports to other programs take, and how late they tell and obey."""
