// Finds calls in a stream of bytes by their constant heads, without a MessagePack decoder.
#pragma once
#include <stdint.h>

#include "protocol.h"

namespace paani {

enum class Method : uint8_t { guide, thrust, esc, status };
constexpr uint8_t METHODS = 4;

// The name of a method as MessagePack writes it: its length, then its letters.
struct MethodName {
    const char* text;
    uint8_t size;
    uint8_t payload_bytes;  // 0: the call has no parameters
};
const MethodName& name_of(Method method);

// Who called: a request is answered with its identifier as it came, a notification (no bytes) not at all.
struct Caller {
    uint8_t id[5];
    uint8_t id_bytes;
};

struct Call {
    Method method;
    Caller caller;
    Verdict verdict;  // NONE: the payload is whole; FRAMING: it is not
    uint8_t payload[MAX_PAYLOAD_BYTES];
};

// A head is found wherever it stands, so that nothing that went wrong before it can swallow a call.
class Scanner {
   public:
    explicit constexpr Scanner(uint8_t methods) : methods_(methods) {}

    // Takes one byte; true when it ended a call, whole or not.
    bool push(uint8_t byte, uint32_t now_ms, Call& call);

    // True when a call was cut off: nothing followed its head for 100 ms.
    bool poll(uint32_t now_ms, Call& call);

   private:
    static constexpr uint8_t WINDOW_BYTES = 64;  // of a power of two, and more than the longest call
    static constexpr uint32_t SILENCE_MS = 100;  // the longest call takes 5 ms at 115200 baud

    uint8_t back(uint8_t steps) const { return window_[static_cast<uint8_t>(end_ - steps) % WINDOW_BYTES]; }
    bool find_head(Method& method, Caller& caller) const;
    bool read_caller(uint8_t name_bytes, Caller& caller) const;
    bool fail(Call& call);

    uint8_t methods_;  // bits of Method: what this line serves
    uint8_t window_[WINDOW_BYTES] = {};
    uint8_t end_ = 0;
    bool is_inside_ = false;  // behind a head
    uint8_t behind_ = 0;      // bytes since the head's name
    uint32_t heard_ms_ = 0;
    Method method_ = Method::status;
    Caller caller_ = {};
};

}  // namespace paani
