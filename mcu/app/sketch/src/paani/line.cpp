#include "line.h"

#include "bytes.h"

namespace paani {

namespace {
constexpr char RESET[] = "\xa7$/reset\x90";
constexpr char REGISTER[] = "\xaa$/register\x91";
constexpr char ROUTE[] = "\xa9paani_mcu";
constexpr uint8_t ROUTE_EXISTS = 5;  // the router's error code; the route is ours, for the line has one end

template <uint8_t N>
constexpr uint8_t length(const char (&)[N]) {
    return N - 1;
}
}  // namespace

void SendQueue::put(uint8_t byte) {
    if (static_cast<uint16_t>(pending_ - start_) >= SIZE) {
        is_whole_ = false;
        return;
    }
    bytes_[pending_ % SIZE] = byte;
    ++pending_;
}

void SendQueue::put(const void* data, uint8_t size) {
    for (uint8_t i = 0; i < size; ++i) {
        put(static_cast<const uint8_t*>(data)[i]);
    }
}

void SendQueue::commit() {
    if (is_whole_) {
        end_ = pending_;
    }
}

bool SendQueue::take(uint8_t& byte) {
    if (start_ == end_) {
        return false;
    }
    byte = bytes_[start_ % SIZE];
    ++start_;
    return true;
}

bool Line::receive(uint8_t byte, uint32_t now_ms, Call& call) {
    hear_answer(byte);
    return scanner_.push(byte, now_ms, call);
}

// Answers to our own requests: `94 01 <id> c0 ..` is the router's consent, `94 01 <id> 92 <code> ..` an error.
void Line::hear_answer(uint8_t byte) {
    if ((newest_bytes_ & 0xFFFF00FFU) == 0x94010092U && byte == ROUTE_EXISTS) {
        settle(static_cast<uint8_t>(newest_bytes_ >> 8U & 0xFFU));
    }
    newest_bytes_ = newest_bytes_ << 8U | byte;
    if ((newest_bytes_ & 0xFFFF00FFU) == 0x940100C0U) {
        settle(static_cast<uint8_t>(newest_bytes_ >> 8U & 0xFFU));
    }
}

void Line::settle(uint8_t id) {
    if (id == RESET_ID && !is_reset_) {
        is_reset_ = true;
        send_registration();
    } else if (id >= REGISTER_ID && id < REGISTER_ID + METHODS) {
        unregistered_ = static_cast<uint8_t>(unregistered_ & ~(1U << (id - REGISTER_ID)));
    }
}

void Line::send_registration() {
    if (!is_reset_) {
        queue_.begin();
        queue_.put(0x94);
        queue_.put(0);
        queue_.put(RESET_ID);
        queue_.put(RESET, length(RESET));
        queue_.commit();
        return;
    }
    for (uint8_t m = 0; m < METHODS; ++m) {
        if ((unregistered_ & 1U << m) != 0) {
            queue_.begin();
            queue_.put(0x94);
            queue_.put(0);
            queue_.put(static_cast<uint8_t>(REGISTER_ID + m));
            queue_.put(REGISTER, length(REGISTER));
            queue_.put_name(name_of(static_cast<Method>(m)));
            queue_.commit();
        }
    }
}

bool Line::poll(uint32_t now_ms, Call& call) {
    const bool is_settled = is_reset_ && unregistered_ == 0;
    const bool is_silent = is_settled && elapsed_ms(now_ms, confirmed_ms_) >= RENEW_MS;
    if (!is_started_ || is_silent) {
        is_started_ = true;
        is_reset_ = false;
        unregistered_ = methods_;
        confirmed_ms_ = now_ms;
        asked_ms_ = now_ms;
        send_registration();
    } else if (!is_settled && elapsed_ms(now_ms, asked_ms_) >= REPEAT_MS) {
        asked_ms_ = now_ms;
        send_registration();
    }
    return scanner_.poll(now_ms, call);
}

void Line::answer(const Caller& caller, const uint8_t status[STATUS_BYTES]) {
    if (caller.id_bytes == 0) {
        return;
    }
    constexpr uint8_t HEAD[] = {0x94, 1};
    constexpr uint8_t RESULT[] = {0xC0, 0xC4, STATUS_BYTES};
    queue_.begin();
    queue_.put(HEAD, sizeof(HEAD));
    queue_.put(caller.id, caller.id_bytes);
    queue_.put(RESULT, sizeof(RESULT));
    queue_.put(status, STATUS_BYTES);
    queue_.commit();
}

void Line::notify(const uint8_t status[STATUS_BYTES]) {
    constexpr uint8_t HEAD[] = {0x93, 2};
    constexpr uint8_t PARAMETERS[] = {0x91, 0xC4, STATUS_BYTES};
    queue_.begin();
    queue_.put(HEAD, sizeof(HEAD));
    queue_.put(ROUTE, length(ROUTE));
    queue_.put(PARAMETERS, sizeof(PARAMETERS));
    queue_.put(status, STATUS_BYTES);
    queue_.commit();
}

}  // namespace paani
