"""The microcontroller's protocol: payloads, messages, lines and calls. `mcu/README.md` defines it."""
