// The core on a computer, as both harnesses of the tests use it: time, bytes and pins come from the test.
#pragma once
#include <stdint.h>

#include "device.h"

namespace harness {

struct Session {
    Session(bool paper, uint32_t now)
        : device(paper ? paani::PAPER_SETTING : paani::PAANI_SETTING, paani::Boot{1, paani::ResetCause::power_on}),
          now_ms(now) {
        inputs.estop = false;
        device.start(now_ms);
    }

    // One turn of the loop, as a platform makes it; the pins take what the core says.
    void step() {
        outputs = device.step(inputs, read_back, now_ms);
        for (int side = 0; side < 2; ++side) {
            read_back.pulse_us[side] = outputs.pulse_us[side];
        }
        read_back.enable = outputs.enable;
        (void)device.report(read_back, now_ms);
    }

    void set_pins(bool estop, uint8_t receiver, uint16_t left_us, uint16_t right_us, uint16_t mv, int16_t ca) {
        inputs.estop = estop;
        inputs.receiver = static_cast<paani::Receiver>(receiver % 3U);
        inputs.receiver_us[0] = left_us;
        inputs.receiver_us[1] = right_us;
        inputs.battery_mv = mv;
        inputs.current_ca = ca;
    }

    paani::Device device;
    paani::Inputs inputs;
    paani::Outputs outputs;
    paani::ReadBack read_back;
    uint32_t now_ms;
};

}  // namespace harness
