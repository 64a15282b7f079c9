"""`paani bench bridge`: the bridge against the firmware on an emulated microcontroller."""
