// The independent watchdog of the STM32U585, by its registers (RM0456, chapter "Independent watchdog"): the board's Arduino
// core does not open it. Once started, nothing but a reset stops it.
#pragma once
#include <stdint.h>

namespace watchdog {

inline volatile uint32_t& at(uint32_t address) { return *reinterpret_cast<volatile uint32_t*>(address); }

constexpr uint32_t KEY = 0x40003000, PRESCALER = 0x40003004, RELOAD = 0x40003008, STATUS = 0x4000300C;
constexpr uint32_t START = 0xCCCC, UNLOCK = 0x5555, FEED = 0xAAAA;
constexpr uint32_t DIVIDE_BY_32 = 3;         // of the 32 kHz oscillator: one count for each millisecond
constexpr uint32_t TIMEOUT_MS = 300;         // the longest lease of thrust
constexpr uint32_t RESET_FLAGS = 0x46020CF4; // RCC_CSR
constexpr uint32_t BY_WATCHDOG = 1U << 29, BY_SOFTWARE = 1U << 28, BY_POWER = 1U << 27, BY_PIN = 1U << 26;
constexpr uint32_t CLEAR_FLAGS = 1U << 23;

inline void feed() { at(KEY) = FEED; }

inline void start() {
    at(KEY) = START;
    at(KEY) = UNLOCK;
    at(PRESCALER) = DIVIDE_BY_32;
    at(RELOAD) = TIMEOUT_MS;
    // The oscillator takes the values over within five of its periods; what never does must not hold up the start.
    for (uint32_t attempts = 0; at(STATUS) != 0 && attempts < 100'000; ++attempts) {
    }
    feed();
}

}  // namespace watchdog
