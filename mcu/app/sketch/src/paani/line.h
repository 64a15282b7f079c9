// One serial line as the board's router sees it: calls in, answers and notifications out, and its own registration.
#pragma once
#include <stdint.h>

#include "scanner.h"

namespace paani {

// What waits to be sent. A message goes in whole or not at all: a peer that does not read stops nothing here.
class SendQueue {
   public:
    void begin() { is_whole_ = true, pending_ = end_; }
    void put(uint8_t byte);
    void put(const void* data, uint8_t size);
    void put_name(const MethodName& name) { put(name.text, name.size); }
    void commit();
    bool take(uint8_t& byte);

   private:
    static constexpr uint16_t SIZE = 512;  // of a power of two; five answers
    uint8_t bytes_[SIZE] = {};
    uint16_t start_ = 0;
    uint16_t end_ = 0;
    uint16_t pending_ = 0;
    bool is_whole_ = true;
};

class Line {
   public:
    explicit constexpr Line(uint8_t methods) : methods_(methods), scanner_(methods) {}

    // Takes one byte; true when it ended a call, whole or not, which is to be judged and answered.
    bool receive(uint8_t byte, uint32_t now_ms, Call& call);
    bool poll(uint32_t now_ms, Call& call);

    void answer(const Caller& caller, const uint8_t status[STATUS_BYTES]);
    void notify(const uint8_t status[STATUS_BYTES]);

    // Frames are accepted: the routes to this line are in order.
    void confirm(uint32_t now_ms) { confirmed_ms_ = now_ms; }

    SendQueue& queue() { return queue_; }

   private:
    // Identifiers of our own requests: of `$/reset`, and of `$/register` for the first method.
    static constexpr uint8_t RESET_ID = 1;
    static constexpr uint8_t REGISTER_ID = 2;
    static constexpr uint32_t REPEAT_MS = 1000;
    static constexpr uint32_t RENEW_MS = 10000;  // the router may have been restarted and know nothing of us

    void hear_answer(uint8_t byte);
    void settle(uint8_t id);
    void send_registration();

    uint8_t methods_;
    Scanner scanner_;
    SendQueue queue_;
    bool is_started_ = false;
    bool is_reset_ = false;       // the router has answered `$/reset`
    uint8_t unregistered_ = 0;    // bits of Method
    uint32_t asked_ms_ = 0;
    uint32_t confirmed_ms_ = 0;
    uint32_t newest_bytes_ = 0;
};

}  // namespace paani
