// Declarations for checking the sketch's syntax; no board's library.
#pragma once
#include <stdint.h>

struct Arduino_LED_Matrix {
    void begin();
    void setGrayscaleBits(uint8_t bits);
    void draw(const uint8_t* lights);
};
