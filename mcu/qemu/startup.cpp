// From reset to main, and the table of interrupts.
#include <stddef.h>
#include <stdint.h>

extern "C" {
extern uint32_t data_start, data_end, data_load, bss_start, bss_end, stack_top;
using Function = void (*)();
extern const Function init_array_start, init_array_end;

int main();
void tick();
void watchdog_expired();
void begin_pulses();
void receive_0();
void receive_1();
void receive_2();

// The compiler calls these for values that it clears or copies as a whole.
void* memset(void* to, int value, size_t size) {
    for (size_t i = 0; i < size; ++i) {
        static_cast<uint8_t*>(to)[i] = static_cast<uint8_t>(value);
    }
    return to;
}

void* memcpy(void* to, const void* from, size_t size) {
    for (size_t i = 0; i < size; ++i) {
        static_cast<uint8_t*>(to)[i] = static_cast<const uint8_t*>(from)[i];
    }
    return to;
}

// What a fault leaves to do: the watchdog's first expiry makes the outputs safe, its second resets.
[[noreturn]] void stand_still() {
    for (;;) {
    }
}

[[noreturn]] void reset_handler() {
    const uint32_t* from = &data_load;
    for (uint32_t* to = &data_start; to < &data_end;) {
        *to++ = *from++;
    }
    for (uint32_t* to = &bss_start; to < &bss_end;) {
        *to++ = 0;
    }
    for (const Function* function = &init_array_start; function < &init_array_end; ++function) {
        (*function)();
    }
    (void)main();
    stand_still();
}

union Vector {
    uint32_t* stack;
    Function function;
};

extern const Vector VECTORS[16 + 40];
__attribute__((section(".vectors"), used)) const Vector VECTORS[16 + 40] = {
    {&stack_top}, {.function = reset_handler}, {.function = watchdog_expired},
    {.function = stand_still}, {.function = stand_still}, {.function = stand_still}, {.function = stand_still}, {.function = stand_still},
    {}, {}, {}, {.function = stand_still}, {.function = stand_still}, {}, {.function = stand_still}, {.function = tick},
    {}, {}, {}, {.function = begin_pulses}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {},
    {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {},
    {.function = receive_0}, {}, {.function = receive_1}, {}, {.function = receive_2}, {}, {}, {},
};
}
