#include "indication.h"

#include "bytes.h"

namespace paani {

Verdict Indication::judge(const uint8_t* payload, Claim& claim, uint32_t now_ms) {
    if (!has_valid_crc(payload, GUIDE_BYTES)) {
        return Verdict::crc;
    }
    if (payload[0] != VERSION) {
        return Verdict::version;
    }
    claim = Claim{read_u16(payload + 2), read_u32(payload + 4), read_u16(payload + 8), read_u16(payload + 16)};
    if (payload[1] >= DIRECTIONS || claim.session == 0 || payload[15] != 0) {
        return Verdict::range;
    }
    for (uint8_t lane = 0; lane < 3; ++lane) {
        const uint8_t risk = payload[12 + lane];
        if (risk > 100 && risk != UNKNOWN_RISK) {
            return Verdict::range;
        }
    }
    return lease_.judge(claim, now_ms);
}

Verdict Indication::receive(const uint8_t* payload, uint32_t now_ms) {
    Claim claim{};
    const Verdict verdict = judge(payload, claim, now_ms);
    counters_.count(verdict);
    if (verdict == Verdict::accepted) {
        lease_.accept(claim, now_ms);
        direction_ = static_cast<Direction>(payload[1]);
        for (uint8_t lane = 0; lane < 3; ++lane) {
            risks_[lane] = payload[12 + lane];
        }
    }
    return verdict;
}

Direction Indication::shown() const {
    switch (lease_.state()) {
        case State::boot:
            return Direction::no_data;
        case State::fresh:
            return direction_;
        default:
            return Direction::stop;
    }
}

uint8_t Indication::risk(uint8_t lane) const { return lease_.state() == State::fresh ? risks_[lane] : UNKNOWN_RISK; }

}  // namespace paani
