"""`paani bench board`: the paper's five-minute protocol, on whatever machine it runs on."""
