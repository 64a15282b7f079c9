// Thrust of two speed controllers: the last decision before force. Whatever is not known to be in order stops them.
#pragma once
#include <stdint.h>

#include "esc.h"
#include "lease.h"
#include "protocol.h"

namespace paani {

enum class Receiver : uint8_t { none, standby, takes_over };

// What the pins say.
struct Inputs {
    bool estop = true;  // the loop through the stop button is open; a broken wire opens it as well
    Receiver receiver = Receiver::none;
    uint16_t receiver_us[2] = {0, 0};
    uint16_t battery_mv = 0;  // 0: not measured, which no limit allows
    int16_t current_ca = 0;
};

// What the pins are to do.
struct Outputs {
    uint16_t pulse_us[2] = {1500, 1500};
    bool enable = false;
};

class Thrust {
   public:
    void start(uint32_t now_ms);

    // Judges the 18 bytes of `paani_thrust` or the 26 of `paani_esc`, counts them, and puts them in force if accepted.
    Verdict receive(const uint8_t* payload, uint32_t now_ms);
    Verdict configure(const uint8_t* payload, uint32_t now_ms);

    // One turn of the loop: lease, holds, slew, outputs.
    Outputs step(const Inputs& inputs, uint32_t now_ms);

    // The loop stood still for so long that the watchdog interfered: as after a reset.
    void disarm();

    uint8_t holds() const { return static_cast<uint8_t>(holds_ | (is_armed_ ? 0 : hold::NOT_ARMED)); }
    const Lease& lease() const { return lease_; }
    Counters& counters() { return counters_; }
    const Counters& counters() const { return counters_; }

   private:
    // A limit counts as exceeded when it is for this long: motors draw short peaks when they start.
    static constexpr uint32_t LIMIT_MS = 100;
    static constexpr int32_t STICK_NEUTRAL_US = 50;  // a receiver's stick this near to neutral is at rest

    struct Limit {
        bool is_exceeded = false;
        uint32_t since_ms = 0;
        bool persists(bool exceeded, uint32_t now_ms);
    };

    Verdict judge(const uint8_t* payload, Claim& claim, uint32_t now_ms);
    void release();  // Linux's hand is off; who drives by the receiver goes on
    void update_holds(const Inputs& inputs, uint32_t now_ms);
    void update_receiver_block(const Inputs& inputs);
    int32_t slew(int32_t applied, int32_t target, int32_t step) const;

    Lease lease_{LeaseRules{50, 300, 0, 0}};
    Counters counters_;
    EscSettings esc_;
    int32_t target_[2] = {0, 0};
    int32_t applied_[2] = {0, 0};
    uint32_t stepped_ms_ = 0;
    uint32_t slew_rest_ = 0;
    uint8_t holds_ = 0;         // latched
    uint8_t active_ = 0;        // what holds at this moment
    bool is_armed_ = false;
    bool may_arm_ = false;      // a disarmed frame was accepted since the last thing that disarms
    bool is_receiver_blocked_ = true;  // until its sticks were at rest after power-up, e-stop or over-current
    Limit battery_, current_;
};

}  // namespace paani
