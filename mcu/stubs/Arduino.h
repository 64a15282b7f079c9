// Declarations for checking the sketch's syntax; no board's core.
#pragma once
#include <stdint.h>

enum { LOW, HIGH };
enum { INPUT, OUTPUT, INPUT_PULLUP };
enum { CHANGE = 2 };
enum { A0 = 14, A1 };

void pinMode(int pin, int mode);
void digitalWrite(int pin, int level);
int digitalRead(int pin);
int analogRead(int pin);
int digitalPinToInterrupt(int pin);
void attachInterrupt(int number, void (*function)(), int mode);
unsigned long millis();
unsigned long micros();
void delay(unsigned long duration_ms);
