#include "thrust.h"

#include "bytes.h"

namespace paani {

namespace {
// A receiver's pulse outside this is no signal.
constexpr bool is_pulse(uint16_t pulse_us) { return pulse_us >= 800 && pulse_us <= 2200; }

constexpr bool has_signal(const Inputs& inputs) {
    return inputs.receiver != Receiver::none && is_pulse(inputs.receiver_us[0]) && is_pulse(inputs.receiver_us[1]);
}
}  // namespace

void Thrust::start(uint32_t now_ms) {
    lease_.start(now_ms);
    stepped_ms_ = now_ms;
}

void Thrust::disarm() {
    release();
    is_receiver_blocked_ = true;
}

void Thrust::release() {
    is_armed_ = false;
    may_arm_ = false;
    applied_[0] = applied_[1] = 0;
}

Verdict Thrust::judge(const uint8_t* payload, Claim& claim, uint32_t now_ms) {
    if (!has_valid_crc(payload, THRUST_BYTES)) {
        return Verdict::crc;
    }
    if (payload[0] != VERSION) {
        return Verdict::version;
    }
    claim = Claim{read_u16(payload + 2), read_u32(payload + 4), read_u16(payload + 8), read_u16(payload + 14)};
    if (payload[1] > 1 || claim.session == 0) {
        return Verdict::range;
    }
    for (uint8_t side = 0; side < 2; ++side) {
        const int32_t thrust = read_i16(payload + 10 + 2 * side);
        if (thrust < -FULL_THRUST || thrust > FULL_THRUST) {
            return Verdict::range;
        }
    }
    const Verdict verdict = lease_.judge(claim, now_ms);
    if ((verdict == Verdict::accepted || verdict == Verdict::replayed) && claim.session != esc_.session) {
        return Verdict::not_configured;
    }
    return verdict;
}

Verdict Thrust::receive(const uint8_t* payload, uint32_t now_ms) {
    Claim claim{};
    const Verdict verdict = judge(payload, claim, now_ms);
    counters_.count(verdict);
    if (verdict != Verdict::accepted) {
        return verdict;
    }
    // A lost link and another process do not go on where the boat was stopped.
    if (lease_.state() == State::safe || lease_.state() == State::boot || claim.session != lease_.session()) {
        release();
    }
    lease_.accept(claim, now_ms);
    if (payload[1] == 0) {
        is_armed_ = false;
        may_arm_ = active_ == 0;
        holds_ &= active_;
    } else if (may_arm_ && holds_ == 0) {
        is_armed_ = true;
    }
    for (uint8_t side = 0; side < 2; ++side) {
        target_[side] = read_i16(payload + 10 + 2 * side);
    }
    return verdict;
}

Verdict Thrust::configure(const uint8_t* payload, uint32_t now_ms) {
    EscSettings settings;
    Verdict verdict = read_esc_settings(payload, settings);
    lease_.poll(now_ms);
    if (verdict == Verdict::accepted && lease_.state() == State::fresh) {
        verdict = Verdict::locked;
    }
    counters_.count(verdict);
    if (verdict == Verdict::accepted) {
        esc_ = settings;
        release();
    }
    return verdict;
}

bool Thrust::Limit::persists(bool exceeded, uint32_t now_ms) {
    if (!exceeded || !is_exceeded) {
        since_ms = now_ms;
    }
    is_exceeded = exceeded;
    return exceeded && elapsed_ms(now_ms, since_ms) >= LIMIT_MS;
}

void Thrust::update_holds(const Inputs& inputs, uint32_t now_ms) {
    const bool is_low = esc_.min_battery_mv != 0 && inputs.battery_mv < esc_.min_battery_mv;
    const bool is_high = esc_.max_current_ca != 0 && inputs.current_ca > static_cast<int32_t>(esc_.max_current_ca);
    active_ = 0;
    if (inputs.estop) {
        active_ |= hold::ESTOP;
    }
    if (inputs.receiver == Receiver::takes_over) {
        active_ |= hold::RECEIVER;
    }
    if (battery_.persists(is_low, now_ms)) {
        active_ |= hold::BATTERY;
    }
    if (current_.persists(is_high, now_ms)) {
        active_ |= hold::CURRENT;
    }
    if (active_ != 0) {
        holds_ |= active_;
        is_armed_ = false;
        may_arm_ = false;
    }
}

void Thrust::update_receiver_block(const Inputs& inputs) {
    if ((active_ & (hold::ESTOP | hold::CURRENT)) != 0) {
        is_receiver_blocked_ = true;
        return;
    }
    bool is_at_rest = has_signal(inputs);
    for (uint8_t side = 0; side < 2; ++side) {
        const int32_t offset_us = inputs.receiver_us[side] - static_cast<int32_t>(esc_.neutral_pulse_us(side));
        is_at_rest = is_at_rest && offset_us >= -STICK_NEUTRAL_US && offset_us <= STICK_NEUTRAL_US;
    }
    is_receiver_blocked_ = is_receiver_blocked_ && !is_at_rest;
}

int32_t Thrust::slew(int32_t applied, int32_t target, int32_t step) const {
    if (applied != 0 && (applied < 0) != (target < 0)) {
        return 0;  // a reversal begins at rest
    }
    if (target >= 0) {
        return target <= applied ? target : (target - applied > step ? applied + step : target);
    }
    return target >= applied ? target : (applied - target > step ? applied - step : target);
}

Outputs Thrust::step(const Inputs& inputs, uint32_t now_ms) {
    lease_.poll(now_ms);
    update_holds(inputs, now_ms);
    update_receiver_block(inputs);
    if (lease_.state() == State::safe) {
        is_armed_ = false;
        may_arm_ = false;
    }
    // A turn of the loop that took longer grants no more than this.
    const uint32_t elapsed = elapsed_ms(now_ms, stepped_ms_) < 100 ? elapsed_ms(now_ms, stepped_ms_) : 100;
    stepped_ms_ = now_ms;
    const uint32_t growth = esc_.slew_per_s * elapsed + slew_rest_;  // in hundredths of a unit of thrust
    slew_rest_ = growth % 100;

    Outputs outputs;
    const bool is_driven = lease_.state() == State::fresh && is_armed_ && holds_ == 0;
    const bool is_by_hand = inputs.receiver == Receiver::takes_over && has_signal(inputs) && !is_receiver_blocked_;
    for (uint8_t side = 0; side < 2; ++side) {
        applied_[side] = is_driven ? slew(applied_[side], target_[side], static_cast<int32_t>(growth / 100)) : 0;
        outputs.pulse_us[side] = is_by_hand ? esc_.receiver_pulse_us(side, inputs.receiver_us[side])
                                            : esc_.thrust_pulse_us(side, applied_[side]);
    }
    outputs.enable = is_driven || is_by_hand;
    return outputs;
}

}  // namespace paani
