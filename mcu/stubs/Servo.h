// Declarations for checking the sketch's syntax; no board's library.
#pragma once

struct Servo {
    void attach(int pin);
    void writeMicroseconds(int width_us);
    int readMicroseconds();
};
