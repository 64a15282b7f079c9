#include "lease.h"

#include "bytes.h"

namespace paani {

void Counters::count(Verdict verdict) {
    if (verdict == Verdict::none) {
        return;
    }
    const uint8_t code = static_cast<uint8_t>(verdict);
    // Not configured and locked share a counter, the eighth; framing has the one behind it.
    const uint8_t place = code <= static_cast<uint8_t>(Verdict::not_configured) ? code : static_cast<uint8_t>(code - 1);
    if (verdict == Verdict::accepted || values[place] != 0xFFFFU) {
        ++values[place];
    }
}

void Lease::start(uint32_t now_ms) {
    state_ = State::boot;
    since_ms_ = now_ms;
}

Verdict Lease::judge(const Claim& claim, uint32_t now_ms) {
    if (claim.lease_ms < rules_.min_ms || claim.lease_ms > rules_.max_ms) {
        return Verdict::lease;
    }
    if (claim.age_ms >= claim.lease_ms) {
        return Verdict::expired;
    }
    poll(now_ms);
    if (state_ == State::fresh && claim.session != session_) {
        return Verdict::foreign_session;
    }
    for (const Session& known : sessions_) {
        if (known.number == claim.session && !is_newer(claim.seq, known.newest_seq)) {
            return Verdict::replayed;
        }
    }
    return Verdict::accepted;
}

void Lease::accept(const Claim& claim, uint32_t now_ms) {
    Session* place = nullptr;
    for (Session& known : sessions_) {
        if (known.number == claim.session) {
            place = &known;
        }
    }
    if (place == nullptr) {
        place = &sessions_[oldest_];
        oldest_ = static_cast<uint8_t>((oldest_ + 1) % REMEMBERED);
    }
    *place = Session{claim.session, claim.seq};
    session_ = claim.session;
    newest_seq_ = claim.seq;
    state_ = State::fresh;
    since_ms_ = now_ms;
    valid_ms_ = rules_.fixed_ms != 0 ? rules_.fixed_ms : static_cast<uint16_t>(claim.lease_ms - claim.age_ms);
}

void Lease::poll(uint32_t now_ms) {
    if (state_ == State::boot && rules_.boot_ms != 0 && elapsed_ms(now_ms, since_ms_) >= rules_.boot_ms) {
        state_ = State::stale;
        since_ms_ += rules_.boot_ms;
    }
    if (state_ == State::fresh && elapsed_ms(now_ms, since_ms_) >= valid_ms_) {
        state_ = State::stale;
        since_ms_ += valid_ms_;
    }
    if (state_ == State::stale && elapsed_ms(now_ms, since_ms_) >= SAFE_AFTER_MS) {
        state_ = State::safe;
    }
}

uint16_t Lease::left_ms(uint32_t now_ms) const {
    const uint32_t gone_ms = elapsed_ms(now_ms, since_ms_);
    return state_ == State::fresh && gone_ms < valid_ms_ ? static_cast<uint16_t>(valid_ms_ - gone_ms) : uint16_t{0};
}

}  // namespace paani
