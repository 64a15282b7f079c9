#include "matrix.h"

namespace paani {

namespace {
constexpr uint8_t ARROW_COLUMNS = 7;
constexpr uint8_t BRIGHT = 7;
constexpr uint8_t DIM = 2;
constexpr uint32_t BLINK_MS = 250;

// One byte for a row, its highest of seven bits on the left. What points right is what points left, mirrored.
constexpr uint8_t PICTURES[][ROWS] = {
    {0b0011100, 0b0100010, 0b0000010, 0b0000100, 0b0001000, 0b0001000, 0b0000000, 0b0001000},  // question mark
    {0b0001000, 0b0011100, 0b0111110, 0b1101011, 0b0001000, 0b0001000, 0b0001000, 0b0001000},  // ahead
    {0b1111000, 0b1110000, 0b1111000, 0b1011100, 0b0001110, 0b0000111, 0b0000011, 0b0000000},  // half left
    {0b0010000, 0b0110000, 0b1111111, 0b1111111, 0b0110000, 0b0010000, 0b0000000, 0b0000000},  // left
    {0b1000001, 0b1100011, 0b0110110, 0b0011100, 0b0011100, 0b0110110, 0b1100011, 0b1000001},  // cross
    {0b1000001, 0b0000000, 0b0000000, 0b0000000, 0b0000000, 0b0000000, 0b0000000, 0b1000001},  // four corners
};

struct Symbol {
    uint8_t picture;
    bool mirrored;
};

// In the order of Direction.
constexpr Symbol SYMBOLS[DIRECTIONS] = {
    {0, false}, {1, false}, {2, false}, {2, true}, {3, false}, {3, true}, {4, false},
};
constexpr Symbol BOOT_SYMBOL{5, false};

void draw_bar(uint8_t column, uint8_t risk, uint8_t* matrix) {
    const uint8_t height = static_cast<uint8_t>((risk * ROWS + 99U) / 100U);
    for (uint8_t row = 0; row < ROWS; ++row) {
        uint8_t& light = matrix[row * COLUMNS + column];
        if (risk == UNKNOWN_RISK) {
            light = row % 2 == 0 ? DIM : 0;
        } else {
            light = ROWS - row <= height ? BRIGHT : 0;
        }
    }
}
}  // namespace

void draw(const Indication& indication, uint32_t now_ms, uint8_t matrix[MATRIX_BYTES]) {
    const State state = indication.lease().state();
    const Symbol symbol = state == State::boot ? BOOT_SYMBOL : SYMBOLS[static_cast<uint8_t>(indication.shown())];
    const bool is_dark = state == State::safe && now_ms / BLINK_MS % 2 != 0;
    for (uint8_t row = 0; row < ROWS; ++row) {
        for (uint8_t column = 0; column < ARROW_COLUMNS; ++column) {
            const uint8_t bit = symbol.mirrored ? column : static_cast<uint8_t>(ARROW_COLUMNS - 1 - column);
            const bool is_lit = (PICTURES[symbol.picture][row] & 1U << bit) != 0 && !is_dark;
            matrix[row * COLUMNS + column] = is_lit ? BRIGHT : 0;
        }
        for (uint8_t column = ARROW_COLUMNS; column < COLUMNS; ++column) {
            matrix[row * COLUMNS + column] = 0;
        }
    }
    for (uint8_t lane = 0; lane < 3; ++lane) {
        draw_bar(static_cast<uint8_t>(ARROW_COLUMNS + 1 + 2 * lane), indication.risk(lane), matrix);
    }
}

}  // namespace paani
