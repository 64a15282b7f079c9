// The light matrix of 8 rows and 13 columns: an arrow, and a bar of risk for each lane.
#pragma once
#include <stdint.h>

#include "indication.h"

namespace paani {

constexpr uint8_t ROWS = 8;
constexpr uint8_t COLUMNS = 13;
constexpr uint8_t MATRIX_BYTES = ROWS * COLUMNS;  // row by row, each light 0 to 7

// The arrow in columns 0 to 6, the bars in columns 8, 10 and 12. In SAFE the stop cross blinks.
void draw(const Indication& indication, uint32_t now_ms, uint8_t matrix[MATRIX_BYTES]);

}  // namespace paani
