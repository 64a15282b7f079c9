"""`paani route`: routes converted between formats and checked."""
