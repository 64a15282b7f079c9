// The registers that the image uses. Source: Arm Application Note AN505 (memory map, interrupts, 20 MHz clock) and the
// Cortex-M System Design Kit manual (UART, watchdog, timers); the system timer is the Armv8-M architecture's.
#pragma once
#include <stdint.h>

namespace hw {

constexpr uint32_t CLOCK_HZ = 20'000'000;
constexpr uint32_t TICKS_PER_US = CLOCK_HZ / 1'000'000;

inline volatile uint32_t& at(uint32_t address) { return *reinterpret_cast<volatile uint32_t*>(address); }

// UART0 to UART2 of the expansion; their receive interrupts are 32, 34 and 36.
struct Uart {
    uint32_t base;
    volatile uint32_t& data() const { return at(base); }
    volatile uint32_t& state() const { return at(base + 0x04); }
    volatile uint32_t& control() const { return at(base + 0x08); }
    volatile uint32_t& interrupt() const { return at(base + 0x0C); }
    volatile uint32_t& divider() const { return at(base + 0x10); }
};
constexpr Uart UARTS[] = {{0x50200000}, {0x50201000}, {0x50202000}};
constexpr uint32_t UART_TX_FULL = 1, UART_RX_FULL = 2;
constexpr uint32_t UART_TX_ENABLE = 1, UART_RX_ENABLE = 2, UART_RX_INTERRUPT_ENABLE = 8;
constexpr uint32_t UART_RX_INTERRUPT = 2;
constexpr uint32_t BAUD = 115'200;

// The watchdog of the secure side: its first expiry is the NMI, its second the reset.
constexpr uint32_t WATCHDOG_LOAD = 0x50081000, WATCHDOG_CONTROL = 0x50081008, WATCHDOG_CLEAR = 0x5008100C;
constexpr uint32_t WATCHDOG_LOCK = 0x50081C00, WATCHDOG_UNLOCK = 0x1ACCE551;
constexpr uint32_t WATCHDOG_INTERRUPT = 1, WATCHDOG_RESET = 2;

// Timer 0 begins a frame of pulses each 20 ms (its interrupt is 3); the dual timer's halves count the pulses down.
constexpr uint32_t TIMER0_CONTROL = 0x50000000, TIMER0_VALUE = 0x50000004, TIMER0_RELOAD = 0x50000008;
constexpr uint32_t TIMER0_CLEAR = 0x5000000C;
constexpr uint32_t TIMER_ENABLE = 1, TIMER_INTERRUPT_ENABLE = 8;
constexpr uint32_t PULSE_LOAD[] = {0x50002000, 0x50002020};
constexpr uint32_t PULSE_CONTROL[] = {0x50002008, 0x50002028};
constexpr uint32_t PULSE_ENABLE = 0x80, PULSE_32_BITS = 2, PULSE_ONE_SHOT = 1;

// The first of the board's user lights is the line that enables the speed controllers.
constexpr uint32_t LIGHTS = 0x50302000;

constexpr uint32_t SYSTICK_CONTROL = 0xE000E010, SYSTICK_RELOAD = 0xE000E014, SYSTICK_VALUE = 0xE000E018;
constexpr uint32_t SYSTICK_ON = 7;  // counts the processor's clock and interrupts
constexpr uint32_t INTERRUPT_ENABLE = 0xE000E100;
constexpr uint32_t TIMER0_INTERRUPT = 3;
constexpr uint32_t UART_INTERRUPTS[] = {32, 34, 36};

}  // namespace hw
