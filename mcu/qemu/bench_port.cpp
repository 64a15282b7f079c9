#include "bench_port.h"

#include "bytes.h"

namespace bench {

void BenchPort::receive(char byte, paani::Inputs& inputs) {
    if (byte != '\n' && byte != '\r') {
        if (size_ < MAX_LINE - 1) {
            line_[size_++] = byte;
        }
        return;
    }
    line_[size_] = '\0';
    if (size_ != 0) {
        obey(inputs);
    }
    size_ = 0;
}

bool BenchPort::begins_with(const char* word) const {
    uint8_t i = 0;
    while (word[i] != '\0' && line_[i] == word[i]) {
        ++i;
    }
    return word[i] == '\0' && (line_[i] == ' ' || line_[i] == '\0');
}

// The whole numbers behind the first word.
uint8_t BenchPort::read_numbers(int32_t numbers[MAX_NUMBERS]) const {
    uint8_t count = 0;
    for (const char* at = line_; *at != '\0' && count < MAX_NUMBERS; ++at) {
        const bool is_negative = at[0] == ' ' && at[1] == '-';
        const char* digit = at + (is_negative ? 2 : 1);
        if (at[0] != ' ' || *digit < '0' || *digit > '9') {
            continue;
        }
        int32_t value = 0;
        for (; *digit >= '0' && *digit <= '9' && value < 100'000; ++digit) {
            value = value * 10 + (*digit - '0');
        }
        numbers[count++] = is_negative ? -value : value;
    }
    return count;
}

void BenchPort::obey(paani::Inputs& inputs) {
    int32_t numbers[MAX_NUMBERS] = {};
    const uint8_t count = read_numbers(numbers);
    if (begins_with("estop") && count == 1) {
        inputs.estop = numbers[0] != 0;
    } else if (begins_with("rc") && count == 3) {
        inputs.receiver = numbers[2] != 0 ? paani::Receiver::takes_over : paani::Receiver::standby;
        inputs.receiver_us[0] = static_cast<uint16_t>(numbers[0]);
        inputs.receiver_us[1] = static_cast<uint16_t>(numbers[1]);
    } else if (begins_with("rc none")) {
        inputs.receiver = paani::Receiver::none;
    } else if (begins_with("battery") && count == 2) {
        inputs.battery_mv = static_cast<uint16_t>(numbers[0]);
        inputs.current_ca = static_cast<int16_t>(numbers[1]);
    } else if (begins_with("hang")) {
        is_hang_asked_ = true;
    } else if (begins_with("stall") && count == 1) {
        stall_ms_ = static_cast<uint32_t>(numbers[0]);
    } else if (begins_with("matrix")) {
        is_matrix_asked_ = true;
    } else {
        queue_.begin();
        put_text("not understood: ");
        put_text(line_);
        put_text("\n");
        queue_.commit();
    }
}

uint32_t BenchPort::take_stall_ms() {
    const uint32_t duration_ms = stall_ms_;
    stall_ms_ = 0;
    return duration_ms;
}

void BenchPort::put_text(const char* text) {
    for (; *text != '\0'; ++text) {
        queue_.put(static_cast<uint8_t>(*text));
    }
}

void BenchPort::put_number(uint32_t number) {
    char digits[10];
    uint8_t count = 0;
    do {
        digits[count++] = static_cast<char>('0' + number % 10);
        number /= 10;
    } while (number != 0);
    while (count != 0) {
        queue_.put(static_cast<uint8_t>(digits[--count]));
    }
}

void BenchPort::report(const paani::ReadBack& pins, uint32_t now_ms) {
    const bool is_new = pins.pulse_us[0] != reported_.pulse_us[0] || pins.pulse_us[1] != reported_.pulse_us[1] ||
                        pins.enable != reported_.enable;
    if (!is_new && paani::elapsed_ms(now_ms, reported_ms_) < PERIOD_MS) {
        return;
    }
    reported_ = pins;
    reported_ms_ = now_ms;
    queue_.begin();
    put_text("pwm ");
    put_number(pins.pulse_us[0]);
    put_text(" ");
    put_number(pins.pulse_us[1]);
    put_text(pins.enable ? " 1 " : " 0 ");
    put_number(now_ms);
    put_text("\n");
    queue_.commit();
}

void BenchPort::report_matrix(const uint8_t* lights) {
    if (!is_matrix_asked_) {
        return;
    }
    is_matrix_asked_ = false;
    queue_.begin();
    put_text("matrix ");
    for (uint8_t i = 0; i < paani::MATRIX_BYTES; ++i) {
        queue_.put(static_cast<uint8_t>('0' + lights[i]));
    }
    put_text("\n");
    queue_.commit();
}

}  // namespace bench
