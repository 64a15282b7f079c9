// The closed lists and sizes of the wire. mcu/README.md defines them.
#pragma once
#include <stdint.h>

namespace paani {

constexpr uint8_t VERSION = 1;
constexpr uint8_t GUIDE_BYTES = 20;
constexpr uint8_t THRUST_BYTES = 18;
constexpr uint8_t ESC_BYTES = 26;
constexpr uint8_t STATUS_BYTES = 52;
constexpr uint8_t MAX_PAYLOAD_BYTES = ESC_BYTES;

enum class Direction : uint8_t { no_data, straight, slight_left, slight_right, left, right, stop };
constexpr uint8_t DIRECTIONS = 7;

enum class State : uint8_t { boot, fresh, stale, safe };

enum class Verdict : uint8_t {
    accepted,
    crc,
    version,
    range,
    replayed,
    foreign_session,
    expired,
    lease,
    not_configured,
    locked,
    framing,
    none = 255,
};

enum class ResetCause : uint8_t { power_on, pin, watchdog, software, unknown };

// What keeps the thrusters still whatever Linux asks for.
namespace hold {
constexpr uint8_t ESTOP = 1;
constexpr uint8_t RECEIVER = 2;
constexpr uint8_t BATTERY = 4;
constexpr uint8_t CURRENT = 8;
constexpr uint8_t NOT_ARMED = 16;
}  // namespace hold

constexpr uint8_t UNKNOWN_RISK = 255;  // instead of a percentage
constexpr uint32_t SAFE_AFTER_MS = 1000;  // of staleness

// `paani`: armed from power-up. `paper`: a loss is reported 1000 ms after the newest frame, but only of a stream that was
// established (the paper's rule for its lights).
struct Setting {
    uint16_t boot_ms;   // without a frame since power-up, indication counts as lost; 0: it is never lost before a first frame
    uint16_t fixed_ms;  // the time-out of indication instead of the frame's lease; 0: the frame's
};
constexpr Setting PAANI_SETTING{1000, 0};
constexpr Setting PAPER_SETTING{0, 1000};

}  // namespace paani
