"""Order statistics, dithering of decisions, and tables of measured figures."""
