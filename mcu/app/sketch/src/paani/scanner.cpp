#include "scanner.h"

#include "bytes.h"

namespace paani {

namespace {
constexpr MethodName NAMES[METHODS] = {
    {"\xabpaani_guide", 12, GUIDE_BYTES},
    {"\xacpaani_thrust", 13, THRUST_BYTES},
    {"\xa9paani_esc", 10, ESC_BYTES},
    {"\xacpaani_status", 13, 0},
};

// What stands between the name and the payload: an array of one, a bin with its length; or an empty array.
constexpr uint8_t ARRAY_OF_ONE = 0x91;
constexpr uint8_t EMPTY_ARRAY = 0x90;
constexpr uint8_t BIN = 0xC4;
constexpr uint8_t OPENING_BYTES = 3;

bool is_opening(uint8_t place, uint8_t byte, uint8_t payload_bytes) {
    if (payload_bytes == 0) {
        return byte == EMPTY_ARRAY;
    }
    return byte == (place == 1 ? ARRAY_OF_ONE : (place == 2 ? BIN : payload_bytes));
}
}  // namespace

const MethodName& name_of(Method method) { return NAMES[static_cast<uint8_t>(method)]; }

// What stands before the name: `94 00` and an identifier of one to five bytes, or `93 02`.
bool Scanner::read_caller(uint8_t name_bytes, Caller& caller) const {
    constexpr struct {
        uint8_t bytes, code;
    } FORMS[] = {{5, 0xCE}, {3, 0xCD}, {2, 0xCC}, {1, 0}};
    for (const auto& form : FORMS) {
        const uint8_t first = back(static_cast<uint8_t>(name_bytes + form.bytes));
        const uint8_t type = back(static_cast<uint8_t>(name_bytes + form.bytes + 1));
        const uint8_t array = back(static_cast<uint8_t>(name_bytes + form.bytes + 2));
        if (array == 0x94 && type == 0 && (form.bytes == 1 ? first < 0x80 : first == form.code)) {
            caller.id_bytes = form.bytes;
            for (uint8_t i = 0; i < form.bytes; ++i) {
                caller.id[i] = back(static_cast<uint8_t>(name_bytes + form.bytes - i));
            }
            return true;
        }
    }
    caller.id_bytes = 0;
    return back(static_cast<uint8_t>(name_bytes + 1)) == 2 && back(static_cast<uint8_t>(name_bytes + 2)) == 0x93;
}

bool Scanner::find_head(Method& method, Caller& caller) const {
    for (uint8_t m = 0; m < METHODS; ++m) {
        const MethodName& name = NAMES[m];
        bool is_here = (methods_ & 1U << m) != 0;
        for (uint8_t i = 0; is_here && i < name.size; ++i) {
            is_here = back(static_cast<uint8_t>(i + 1)) == static_cast<uint8_t>(name.text[name.size - 1 - i]);
        }
        if (is_here && read_caller(name.size, caller)) {
            method = static_cast<Method>(m);
            return true;
        }
    }
    return false;
}

bool Scanner::fail(Call& call) {
    is_inside_ = false;
    call.method = method_;
    call.caller = caller_;
    call.verdict = Verdict::framing;
    return true;
}

bool Scanner::push(uint8_t byte, uint32_t now_ms, Call& call) {
    window_[end_ % WINDOW_BYTES] = byte;
    ++end_;
    heard_ms_ = now_ms;
    Method method{};
    Caller caller{};
    if (find_head(method, caller)) {
        const bool was_inside = is_inside_;
        if (was_inside) {
            (void)fail(call);  // the call before was cut off
        }
        is_inside_ = true;
        behind_ = 0;
        method_ = method;
        caller_ = caller;
        return was_inside;
    }
    if (!is_inside_) {
        return false;
    }
    ++behind_;
    const uint8_t payload_bytes = name_of(method_).payload_bytes;
    const uint8_t opening_bytes = payload_bytes == 0 ? uint8_t{1} : OPENING_BYTES;
    if (behind_ <= opening_bytes && !is_opening(behind_, byte, payload_bytes)) {
        return fail(call);
    }
    if (behind_ < opening_bytes + payload_bytes) {
        return false;
    }
    is_inside_ = false;
    call.method = method_;
    call.caller = caller_;
    call.verdict = Verdict::none;
    for (uint8_t i = 0; i < payload_bytes; ++i) {
        call.payload[i] = back(static_cast<uint8_t>(payload_bytes - i));
    }
    return true;
}

bool Scanner::poll(uint32_t now_ms, Call& call) {
    return is_inside_ && elapsed_ms(now_ms, heard_ms_) >= SILENCE_MS && fail(call);
}

}  // namespace paani
