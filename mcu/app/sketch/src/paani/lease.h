// How long a frame may be acted on: session, sequence and time-out, judged on the microcontroller's own clock.
#pragma once
#include <stdint.h>

#include "protocol.h"

namespace paani {

// What a frame says of its own validity.
struct Claim {
    uint16_t session;
    uint32_t seq;
    uint16_t lease_ms;
    uint16_t age_ms;
};

struct LeaseRules {
    uint16_t min_ms, max_ms;  // what a frame may ask for
    uint16_t boot_ms;         // see Setting
    uint16_t fixed_ms;
};

// Counts of frames by verdict, in the order of the status: accepted ones wrap, refusals stay at 65535.
struct Counters {
    static constexpr uint8_t SIZE = 10;
    uint16_t values[SIZE] = {};
    void count(Verdict verdict);
};

class Lease {
   public:
    explicit constexpr Lease(const LeaseRules& rules) : rules_(rules) {}

    // Begins to run, in BOOT.
    void start(uint32_t now_ms);

    // Whether a frame with these claims is to be accepted. Changes nothing.
    Verdict judge(const Claim& claim, uint32_t now_ms);

    // Puts an accepted frame in force: the state is FRESH.
    void accept(const Claim& claim, uint32_t now_ms);

    // Lets the lease run out. Called from the loop, whether or not anything was received.
    void poll(uint32_t now_ms);

    State state() const { return state_; }
    uint16_t session() const { return session_; }
    uint32_t newest_seq() const { return newest_seq_; }
    uint16_t left_ms(uint32_t now_ms) const;

   private:
    struct Session {
        uint16_t number;
        uint32_t newest_seq;
    };
    // A frame of an earlier session that was delayed on its way is still a replay: so many sessions are remembered.
    static constexpr uint8_t REMEMBERED = 4;

    LeaseRules rules_;
    State state_ = State::boot;
    uint16_t session_ = 0;
    uint32_t newest_seq_ = 0;
    uint32_t since_ms_ = 0;  // when the state was entered
    uint16_t valid_ms_ = 0;
    Session sessions_[REMEMBERED] = {};
    uint8_t oldest_ = 0;  // place that the next session takes
};

}  // namespace paani
