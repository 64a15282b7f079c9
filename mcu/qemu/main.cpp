// The core on QEMU's `mps2-an505`: UART0 carries guidance, UART1 thrust, UART2 the test harness.
#include <stdint.h>

#include "bench_port.h"
#include "device.h"
#include "registers.h"

namespace {

#ifdef PAANI_PAPER
constexpr paani::Setting SETTING = paani::PAPER_SETTING;
#else
constexpr paani::Setting SETTING = paani::PAANI_SETTING;
#endif

constexpr uint32_t FRAME_US = 20'000;  // hobby speed controllers expect a pulse 50 times a second
constexpr uint16_t NEUTRAL_US = 1500;
// No longer than the longest lease of thrust, so that a loop that hangs keeps the boat moving no longer than a dead link.
constexpr uint32_t WATCHDOG_US = 300'000;
constexpr uint32_t LATE_LOOP_MS = 50;  // the loop turns each millisecond

// Survives a reset, but not the loss of power, after which the check does not hold.
struct Memory {
    uint32_t boot_count;
    uint32_t check;
    paani::ResetCause next_cause;  // written by whoever is about to cause a reset
};
constexpr uint32_t CHECK = 0x50AA4149;
__attribute__((section(".noinit"))) Memory memory;

volatile uint32_t now_ms;
volatile uint32_t looped_ms;
volatile bool is_interrupted;  // something made the outputs safe behind the loop's back
volatile uint16_t next_pulse_us[2] = {NEUTRAL_US, NEUTRAL_US};

// Bytes between an interrupt and the loop. One that finds no room is lost, and its call with it.
struct Received {
    static constexpr uint16_t SIZE = 1024;  // of a power of two; 90 ms at 115200 baud
    uint8_t bytes[SIZE];
    volatile uint16_t start, end;

    void put(uint8_t byte) {
        if (static_cast<uint16_t>(end - start) < SIZE) {
            bytes[end % SIZE] = byte;
            end = static_cast<uint16_t>(end + 1);
        }
    }
    bool take(uint8_t& byte) {
        if (start == end) {
            return false;
        }
        byte = bytes[start % SIZE];
        start = static_cast<uint16_t>(start + 1);
        return true;
    }
};
Received received[3];

void take_byte(uint8_t uart) {
    hw::UARTS[uart].interrupt() = hw::UART_RX_INTERRUPT;
    while ((hw::UARTS[uart].state() & hw::UART_RX_FULL) != 0) {
        received[uart].put(static_cast<uint8_t>(hw::UARTS[uart].data()));
    }
}

void make_outputs_safe() {
    hw::at(hw::LIGHTS) = 0;
    for (uint8_t side = 0; side < 2; ++side) {
        next_pulse_us[side] = NEUTRAL_US;
        hw::at(hw::PULSE_LOAD[side]) = NEUTRAL_US * hw::TICKS_PER_US;
    }
    is_interrupted = true;
}

void feed_watchdog() { hw::at(hw::WATCHDOG_CLEAR) = 1; }

paani::Boot boot() {
    if (memory.check != (CHECK ^ memory.boot_count)) {
        memory = Memory{0, 0, paani::ResetCause::power_on};
    }
    const paani::Boot boot{static_cast<uint16_t>(++memory.boot_count), memory.next_cause};
    memory.check = CHECK ^ memory.boot_count;
    memory.next_cause = paani::ResetCause::pin;
    return boot;
}

void set_up() {
    for (uint8_t side = 0; side < 2; ++side) {
        hw::at(hw::PULSE_CONTROL[side]) = hw::PULSE_ENABLE | hw::PULSE_32_BITS | hw::PULSE_ONE_SHOT;
    }
    make_outputs_safe();
    is_interrupted = false;

    hw::at(hw::SYSTICK_RELOAD) = hw::CLOCK_HZ / 1000 - 1;
    hw::at(hw::SYSTICK_VALUE) = 0;
    hw::at(hw::SYSTICK_CONTROL) = hw::SYSTICK_ON;
    hw::at(hw::TIMER0_RELOAD) = FRAME_US * hw::TICKS_PER_US - 1;
    hw::at(hw::TIMER0_VALUE) = FRAME_US * hw::TICKS_PER_US - 1;
    hw::at(hw::TIMER0_CONTROL) = hw::TIMER_ENABLE | hw::TIMER_INTERRUPT_ENABLE;
    hw::at(hw::INTERRUPT_ENABLE) = 1U << hw::TIMER0_INTERRUPT;

    hw::at(hw::WATCHDOG_LOCK) = hw::WATCHDOG_UNLOCK;
    hw::at(hw::WATCHDOG_LOAD) = WATCHDOG_US * hw::TICKS_PER_US;
    hw::at(hw::WATCHDOG_CONTROL) = hw::WATCHDOG_INTERRUPT | hw::WATCHDOG_RESET;

    for (uint8_t uart = 0; uart < 3; ++uart) {
        hw::UARTS[uart].divider() = hw::CLOCK_HZ / hw::BAUD;
        hw::UARTS[uart].control() = hw::UART_TX_ENABLE | hw::UART_RX_ENABLE | hw::UART_RX_INTERRUPT_ENABLE;
        hw::at(hw::INTERRUPT_ENABLE + 4) = 1U << (hw::UART_INTERRUPTS[uart] - 32);
    }
}

paani::ReadBack read_pins() {
    paani::ReadBack pins;
    for (uint8_t side = 0; side < 2; ++side) {
        pins.pulse_us[side] = static_cast<uint16_t>(hw::at(hw::PULSE_LOAD[side]) / hw::TICKS_PER_US);
    }
    pins.enable = (hw::at(hw::LIGHTS) & 1U) != 0;
    return pins;
}

// The enable line acts at once; a pulse width with the next frame, so that no pulse changes while it lasts.
void set_pins(const paani::Outputs& outputs) {
    for (uint8_t side = 0; side < 2; ++side) {
        next_pulse_us[side] = outputs.pulse_us[side];
    }
    hw::at(hw::LIGHTS) = outputs.enable ? 1U : 0U;
}

bool can_send(uint8_t uart) { return (hw::UARTS[uart].state() & hw::UART_TX_FULL) == 0; }

[[noreturn]] void hang() {
    asm volatile("cpsid i" ::: "memory");
    for (;;) {
    }
}

}  // namespace

extern "C" {

void tick() {
    now_ms = now_ms + 1;
    if (now_ms - looped_ms > LATE_LOOP_MS) {
        make_outputs_safe();
    }
}

// The watchdog's first expiry, which no masking of interrupts holds back. Unless the loop comes back, the second resets.
void watchdog_expired() {
    make_outputs_safe();
    memory.next_cause = paani::ResetCause::watchdog;
}

void begin_pulses() {
    hw::at(hw::TIMER0_CLEAR) = 1;
    for (uint8_t side = 0; side < 2; ++side) {
        hw::at(hw::PULSE_LOAD[side]) = next_pulse_us[side] * hw::TICKS_PER_US;
    }
}

void receive_0() { take_byte(0); }
void receive_1() { take_byte(1); }
void receive_2() { take_byte(2); }

int main() {
    set_up();
    static paani::Device device(SETTING, boot());
    static bench::BenchPort bench_port;
    paani::Inputs inputs;
    inputs.estop = false;  // the harness closes the loop through the stop button
    device.start(now_ms);
    for (;;) {
        const uint32_t turn_ms = now_ms;
        looped_ms = turn_ms;
        if (is_interrupted) {
            is_interrupted = false;
            memory.next_cause = paani::ResetCause::pin;
            device.disarm();
        }
        uint8_t byte = 0;
        for (uint8_t line = 0; line < paani::LINES; ++line) {
            while (received[line].take(byte)) {
                device.receive(line, byte, turn_ms);
            }
        }
        while (received[2].take(byte)) {
            bench_port.receive(static_cast<char>(byte), inputs);
        }
        const uint32_t stall_ms = bench_port.take_stall_ms();
        for (const uint32_t since_ms = now_ms; now_ms - since_ms < stall_ms;) {
        }
        set_pins(device.step(inputs, read_pins(), turn_ms));
        (void)device.report(read_pins(), turn_ms);
        bench_port.report(read_pins(), turn_ms);
        bench_port.report_matrix(device.matrix());
        if (bench_port.is_hang_asked()) {
            hang();
        }
        feed_watchdog();
        for (uint8_t line = 0; line < paani::LINES; ++line) {
            while (can_send(line) && device.take(line, byte)) {
                hw::UARTS[line].data() = byte;
            }
        }
        while (can_send(2) && bench_port.take(byte)) {
            hw::UARTS[2].data() = byte;
        }
        while (now_ms == turn_ms) {
            asm volatile("wfi");
        }
    }
}
}
