"""Bridge: the advice as bounded symbols, to the microcontroller that shows it."""
