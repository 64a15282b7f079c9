// The two speed controllers: settings, and thrust as pulse widths.
#pragma once
#include <stdint.h>

#include "protocol.h"

namespace paani {

constexpr int32_t FULL_THRUST = 10000;  // thrust of 1.0
// The range of hobby servos and speed controllers; no pulse leaves it.
constexpr int32_t MIN_PULSE_US = 1000;
constexpr int32_t MAX_PULSE_US = 2000;

struct Side {
    bool reversed = false;
    int16_t trim_us = 0;
    uint16_t deadband_us = 0;
};

struct EscSettings {
    uint16_t session = 0;  // 0: never configured
    Side sides[2];
    uint16_t neutral_us = 1500;
    uint16_t span_us = 400;
    uint16_t slew_per_s = 1000;     // thousandths of full thrust
    uint16_t min_battery_mv = 0;    // 0: no limit
    uint16_t max_current_ca = 0;    // 10 mA; 0: no limit

    uint16_t neutral_pulse_us(uint8_t side) const { return limit_pulse(neutral_us + sides[side].trim_us); }

    // The pulse for a thrust of -FULL_THRUST to FULL_THRUST: beyond the deadband at once, `span_us` from neutral at full.
    uint16_t thrust_pulse_us(uint8_t side, int32_t thrust) const;

    // A receiver's pulse, no further from neutral than thrust of ours may be.
    uint16_t receiver_pulse_us(uint8_t side, uint16_t pulse_us) const;

    static uint16_t limit_pulse(int32_t pulse_us);
};

// Reads the 26 bytes of `paani_esc`; the settings are written only if the verdict is ACCEPTED.
Verdict read_esc_settings(const uint8_t* payload, EscSettings& settings);

}  // namespace paani
