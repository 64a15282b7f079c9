"""`paani bench deck`: the page as a browser has it, and what it costs the boat."""
