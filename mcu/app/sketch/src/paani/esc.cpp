#include "esc.h"

#include "bytes.h"

namespace paani {

namespace {
constexpr int32_t clamp(int32_t value, int32_t low, int32_t high) {
    return value < low ? low : (value > high ? high : value);
}
}  // namespace

uint16_t EscSettings::limit_pulse(int32_t pulse_us) {
    return static_cast<uint16_t>(clamp(pulse_us, MIN_PULSE_US, MAX_PULSE_US));
}

uint16_t EscSettings::thrust_pulse_us(uint8_t side, int32_t thrust) const {
    const Side& esc = sides[side];
    int32_t offset_us = 0;
    if (thrust != 0) {
        const int32_t size = thrust < 0 ? -thrust : thrust;
        offset_us = esc.deadband_us + (span_us - esc.deadband_us) * size / FULL_THRUST;
    }
    const bool is_backwards = (thrust < 0) != esc.reversed;
    return limit_pulse(neutral_us + esc.trim_us + (is_backwards ? -offset_us : offset_us));
}

uint16_t EscSettings::receiver_pulse_us(uint8_t side, uint16_t pulse_us) const {
    const int32_t neutral = neutral_us + sides[side].trim_us;
    return limit_pulse(clamp(pulse_us, neutral - span_us, neutral + span_us));
}

Verdict read_esc_settings(const uint8_t* payload, EscSettings& settings) {
    if (!has_valid_crc(payload, ESC_BYTES)) {
        return Verdict::crc;
    }
    if (payload[0] != VERSION) {
        return Verdict::version;
    }
    EscSettings read;
    read.session = read_u16(payload + 2);
    for (uint8_t side = 0; side < 2; ++side) {
        read.sides[side].reversed = (payload[1] & 1U << side) != 0;
        read.sides[side].trim_us = read_i16(payload + 4 + 2 * side);
        read.sides[side].deadband_us = read_u16(payload + 12 + 2 * side);
        if (read.sides[side].trim_us < -200 || read.sides[side].trim_us > 200 || read.sides[side].deadband_us > 100) {
            return Verdict::range;
        }
    }
    read.neutral_us = read_u16(payload + 8);
    read.span_us = read_u16(payload + 10);
    read.slew_per_s = read_u16(payload + 16);
    read.min_battery_mv = read_u16(payload + 18);
    read.max_current_ca = read_u16(payload + 20);
    const bool is_in_range = payload[1] <= 3 && read.session != 0 && read.neutral_us >= 1400 &&
                             read.neutral_us <= 1600 && read.span_us >= 100 && read.span_us <= 500 &&
                             read.slew_per_s >= 100 && read.slew_per_s <= 10000 && read_u16(payload + 22) == 0;
    if (!is_in_range) {
        return Verdict::range;
    }
    settings = read;
    return Verdict::accepted;
}

}  // namespace paani
