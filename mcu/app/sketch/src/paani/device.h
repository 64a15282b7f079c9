// The whole microcontroller but for its pins: two lines, the lights, the thrusters. A platform carries bytes and pins.
#pragma once
#include <stdint.h>

#include "indication.h"
#include "line.h"
#include "matrix.h"
#include "thrust.h"

namespace paani {

struct Boot {
    uint16_t count;
    ResetCause cause;
};

// What the pins do, read back from where the hardware holds it.
struct ReadBack {
    uint16_t pulse_us[2] = {0, 0};
    bool enable = false;
};

constexpr uint8_t INDICATION_LINE = 0;
constexpr uint8_t THRUST_LINE = 1;
constexpr uint8_t LINES = 2;

class Device {
   public:
    constexpr Device(const Setting& setting, const Boot& boot)
        : boot_(boot), indication_(setting), lines_{Line(LINE_METHODS[0]), Line(LINE_METHODS[1])} {}

    void start(uint32_t now_ms);

    // A byte that came on a line.
    void receive(uint8_t line, uint8_t byte, uint32_t now_ms);

    // A call that something else has already taken out of its stream: judged, and answered in `status`.
    void call(Method method, const uint8_t* payload, uint32_t size, uint32_t now_ms, uint8_t status[STATUS_BYTES]);

    // One turn of the loop: leases run out, lights are drawn, the answer says what the pins are to do.
    Outputs step(const Inputs& inputs, const ReadBack& read_back, uint32_t now_ms);

    // Sends the state of each line on which it changed; true if there was one. After the pins were set.
    bool report(const ReadBack& read_back, uint32_t now_ms);

    // The next byte to send on a line, if there is one.
    bool take(uint8_t line, uint8_t& byte) { return lines_[line].queue().take(byte); }

    void disarm() { thrust_.disarm(); }
    const uint8_t* matrix() const { return matrix_; }
    void write_status(uint8_t line, Verdict verdict, uint32_t now_ms, uint8_t status[STATUS_BYTES]) const;

   private:
    static constexpr uint8_t LINE_METHODS[LINES] = {
        static_cast<uint8_t>(1U << static_cast<uint8_t>(Method::guide) | 1U << static_cast<uint8_t>(Method::status)),
        static_cast<uint8_t>(1U << static_cast<uint8_t>(Method::thrust) | 1U << static_cast<uint8_t>(Method::esc) |
                             1U << static_cast<uint8_t>(Method::status)),
    };

    Verdict judge(uint8_t line, const Call& call, uint32_t now_ms);
    void handle(uint8_t line, const Call& call, uint32_t now_ms);

    Boot boot_;
    Indication indication_;
    Thrust thrust_;
    Line lines_[LINES];
    Inputs inputs_;
    ReadBack read_back_;
    uint8_t matrix_[MATRIX_BYTES] = {};
    uint32_t reported_[LINES] = {0xFFFFFFFFU, 0xFFFFFFFFU};  // the states that were reported last
};

}  // namespace paani
