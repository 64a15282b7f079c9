"""`paani models report`: one page that shows what was measured, curves and pictures included."""
