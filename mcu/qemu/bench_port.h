// The port of the test harness: pins in, a logic analyser out, as lines of text. No board has it.
#pragma once
#include <stdint.h>

#include "device.h"

namespace bench {

class BenchPort {
   public:
    // Takes one byte of `estop 0|1`, `rc LEFT_US RIGHT_US TAKE`, `rc none`, `battery MV CA`, `hang`, `stall MS`, `matrix`.
    void receive(char byte, paani::Inputs& inputs);

    // Says what the pins do whenever that changes, and 50 times a second: `pwm LEFT_US RIGHT_US ENABLE MCU_MS`.
    void report(const paani::ReadBack& pins, uint32_t now_ms);

    // Says the lights, a digit for each, if they were asked for: `matrix DIGITS`.
    void report_matrix(const uint8_t* lights);

    bool is_hang_asked() const { return is_hang_asked_; }

    // For how long the loop is to stand still, once; 0: it is to go on.
    uint32_t take_stall_ms();
    bool take(uint8_t& byte) { return queue_.take(byte); }

   private:
    static constexpr uint8_t MAX_LINE = 40;
    static constexpr uint8_t MAX_NUMBERS = 3;
    static constexpr uint32_t PERIOD_MS = 20;

    void obey(paani::Inputs& inputs);
    bool begins_with(const char* word) const;
    uint8_t read_numbers(int32_t numbers[MAX_NUMBERS]) const;
    void put_text(const char* text);
    void put_number(uint32_t number);

    paani::SendQueue queue_;
    char line_[MAX_LINE] = {};
    uint8_t size_ = 0;
    bool is_hang_asked_ = false;
    uint32_t stall_ms_ = 0;
    bool is_matrix_asked_ = false;
    paani::ReadBack reported_;
    uint32_t reported_ms_ = 0;
};

}  // namespace bench
