#include "bytes.h"

namespace paani {

uint16_t crc16(const uint8_t* data, uint32_t size) {
    uint32_t crc = 0xFFFFU;
    for (uint32_t i = 0; i < size; ++i) {
        crc ^= static_cast<uint32_t>(data[i]) << 8U;
        for (int bit = 0; bit < 8; ++bit) {
            crc = (crc & 0x8000U) != 0 ? (crc << 1U) ^ 0x1021U : crc << 1U;
        }
        crc &= 0xFFFFU;
    }
    return static_cast<uint16_t>(crc);
}

bool has_valid_crc(const uint8_t* payload, uint32_t size) {
    return crc16(payload, size - 2) == read_u16(payload + size - 2);
}

}  // namespace paani
