// The advice that the lights show. It informs an operator and moves nothing.
#pragma once
#include <stdint.h>

#include "lease.h"
#include "protocol.h"

namespace paani {

class Indication {
   public:
    explicit constexpr Indication(const Setting& setting)
        : lease_(LeaseRules{50, 4000, setting.boot_ms, setting.fixed_ms}) {}

    void start(uint32_t now_ms) { lease_.start(now_ms); }
    void poll(uint32_t now_ms) { lease_.poll(now_ms); }

    // Judges the 20 bytes of `paani_guide`, counts them, and puts them in force if they are accepted.
    Verdict receive(const uint8_t* payload, uint32_t now_ms);

    // What the arrow says: the advice while its lease runs, NO_DATA before there was any, otherwise STOP.
    Direction shown() const;

    // Left, centre and right in percent, or UNKNOWN_RISK.
    uint8_t risk(uint8_t lane) const;

    const Lease& lease() const { return lease_; }
    Counters& counters() { return counters_; }
    const Counters& counters() const { return counters_; }

   private:
    Verdict judge(const uint8_t* payload, Claim& claim, uint32_t now_ms);

    Lease lease_;
    Counters counters_;
    Direction direction_ = Direction::no_data;
    uint8_t risks_[3] = {UNKNOWN_RISK, UNKNOWN_RISK, UNKNOWN_RISK};
};

}  // namespace paani
