// Little-endian fields of a payload, its CRC, and the arithmetic of a 32-bit millisecond clock.
#pragma once
#include <stdint.h>

namespace paani {

constexpr uint16_t read_u16(const uint8_t* from) { return static_cast<uint16_t>(from[0] | from[1] << 8); }

constexpr int16_t read_i16(const uint8_t* from) {
    const int32_t value = read_u16(from);
    return static_cast<int16_t>(value < 0x8000 ? value : value - 0x10000);
}

constexpr uint32_t read_u32(const uint8_t* from) {
    return read_u16(from) | static_cast<uint32_t>(read_u16(from + 2)) << 16;
}

constexpr void write_u16(uint8_t* to, uint16_t value) {
    to[0] = static_cast<uint8_t>(value & 0xFFU);
    to[1] = static_cast<uint8_t>(value >> 8U);
}

constexpr void write_u32(uint8_t* to, uint32_t value) {
    write_u16(to, static_cast<uint16_t>(value & 0xFFFFU));
    write_u16(to + 2, static_cast<uint16_t>(value >> 16U));
}

// CRC-16/CCITT-FALSE: polynomial 0x1021, begins with 0xFFFF, neither reflected nor inverted.
uint16_t crc16(const uint8_t* data, uint32_t size);

// Whether the last two bytes are the CRC of those before them.
bool has_valid_crc(const uint8_t* payload, uint32_t size);

// Milliseconds from `since` to `now`. The clock wraps after 49.7 days; the difference of unsigned numbers does not mind.
constexpr uint32_t elapsed_ms(uint32_t now_ms, uint32_t since_ms) { return now_ms - since_ms; }

// Whether a sequence number comes after another one, in serial-number arithmetic (RFC 1982).
constexpr bool is_newer(uint32_t seq, uint32_t than) { return seq != than && seq - than < 0x80000000U; }

}  // namespace paani
