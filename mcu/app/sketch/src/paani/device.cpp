#include "device.h"

#include "bytes.h"

namespace paani {

constexpr uint8_t Device::LINE_METHODS[LINES];

void Device::start(uint32_t now_ms) {
    indication_.start(now_ms);
    thrust_.start(now_ms);
}

Verdict Device::judge(uint8_t line, const Call& call, uint32_t now_ms) {
    if (call.verdict == Verdict::framing) {
        (line == INDICATION_LINE ? indication_.counters() : thrust_.counters()).count(Verdict::framing);
        return Verdict::framing;
    }
    switch (call.method) {
        case Method::guide:
            return indication_.receive(call.payload, now_ms);
        case Method::thrust:
            return thrust_.receive(call.payload, now_ms);
        case Method::esc:
            return thrust_.configure(call.payload, now_ms);
        default:
            return Verdict::none;
    }
}

void Device::handle(uint8_t line, const Call& call, uint32_t now_ms) {
    uint8_t status[STATUS_BYTES];
    const Verdict verdict = judge(line, call, now_ms);
    if (verdict == Verdict::accepted) {
        lines_[line].confirm(now_ms);
    }
    write_status(line, verdict, now_ms, status);
    lines_[line].answer(call.caller, status);
}

void Device::receive(uint8_t line, uint8_t byte, uint32_t now_ms) {
    Call call{};
    if (lines_[line].receive(byte, now_ms, call)) {
        handle(line, call, now_ms);
    }
}

void Device::call(Method method, const uint8_t* payload, uint32_t size, uint32_t now_ms, uint8_t status[STATUS_BYTES]) {
    const uint8_t line = method == Method::thrust || method == Method::esc ? THRUST_LINE : INDICATION_LINE;
    Call call{};
    call.method = method;
    call.verdict = size == name_of(method).payload_bytes ? Verdict::none : Verdict::framing;
    for (uint8_t i = 0; call.verdict == Verdict::none && i < size; ++i) {
        call.payload[i] = payload[i];
    }
    write_status(line, judge(line, call, now_ms), now_ms, status);
}

Outputs Device::step(const Inputs& inputs, const ReadBack& read_back, uint32_t now_ms) {
    inputs_ = inputs;
    read_back_ = read_back;
    for (uint8_t line = 0; line < LINES; ++line) {
        Call call{};
        if (lines_[line].poll(now_ms, call)) {
            handle(line, call, now_ms);
        }
    }
    indication_.poll(now_ms);
    draw(indication_, now_ms, matrix_);
    return thrust_.step(inputs, now_ms);
}

bool Device::report(const ReadBack& read_back, uint32_t now_ms) {
    read_back_ = read_back;
    const uint32_t states[LINES] = {
        static_cast<uint32_t>(indication_.lease().state()),
        static_cast<uint32_t>(thrust_.lease().state()) | static_cast<uint32_t>(thrust_.holds()) << 8U |
            static_cast<uint32_t>(read_back.enable) << 16U,
    };
    bool is_new = false;
    for (uint8_t line = 0; line < LINES; ++line) {
        if (states[line] != reported_[line]) {
            uint8_t status[STATUS_BYTES];
            reported_[line] = states[line];
            write_status(line, Verdict::none, now_ms, status);
            lines_[line].notify(status);
            is_new = true;
        }
    }
    return is_new;
}

void Device::write_status(uint8_t line, Verdict verdict, uint32_t now_ms, uint8_t status[STATUS_BYTES]) const {
    const bool is_thrust = line == THRUST_LINE;
    const Lease& lease = is_thrust ? thrust_.lease() : indication_.lease();
    const Counters& counters = is_thrust ? thrust_.counters() : indication_.counters();
    status[0] = VERSION;
    status[1] = is_thrust ? 2 : 1;
    status[2] = static_cast<uint8_t>(lease.state());
    status[3] = static_cast<uint8_t>(verdict);
    write_u16(status + 4, lease.session());
    write_u16(status + 6, boot_.count);
    write_u32(status + 8, lease.newest_seq());
    write_u32(status + 12, now_ms);
    status[16] = static_cast<uint8_t>(boot_.cause);
    status[17] = is_thrust ? thrust_.holds() : static_cast<uint8_t>(indication_.shown());
    write_u16(status + 18, lease.left_ms(now_ms));
    for (uint8_t i = 0; i < Counters::SIZE; ++i) {
        write_u16(status + 20 + 2 * i, counters.values[i]);
    }
    for (uint8_t side = 0; side < 2; ++side) {
        write_u16(status + 40 + 2 * side, is_thrust ? read_back_.pulse_us[side] : uint16_t{0});
    }
    write_u16(status + 44, inputs_.battery_mv);
    write_u16(status + 46, static_cast<uint16_t>(inputs_.current_ca));
    status[48] = is_thrust && read_back_.enable ? 1 : 0;
    status[49] = static_cast<uint8_t>(inputs_.receiver);
    write_u16(status + 50, crc16(status, STATUS_BYTES - 2));
}

}  // namespace paani
