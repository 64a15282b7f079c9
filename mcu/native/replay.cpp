// Plays a script from standard input through the core and writes what it sends, for AddressSanitizer to watch: it cannot
// be loaded into a running Python. A record is a letter, a size (16 bits, little-endian) and so many bytes:
//   0, 1  bytes that come on this line        t  time, 32 bits: runs the loop, a turn each millisecond
//   p     pins: e-stop, receiver (8 bits each), two pulses, millivolts, 10 mA (16 bits each)
//   !     reads one byte behind a block of memory, to show that the watch is awake
// Everything sent on line 0 goes to standard output and everything sent on line 1 behind it, then the lights.
#include <stdint.h>
#include <stdio.h>

#include <vector>

#include "bytes.h"
#include "session.h"

int main(int argc, char**) {
    harness::Session session(argc > 1, 0);
    std::vector<uint8_t> sent[paani::LINES];
    int kind = 0;
    while ((kind = getchar()) != EOF) {
        const int low = getchar();
        const int high = getchar();
        if (low == EOF || high == EOF) {
            return 2;
        }
        std::vector<uint8_t> data(static_cast<size_t>(low | high << 8));
        if (fread(data.data(), 1, data.size(), stdin) != data.size()) {
            return 2;
        }
        if (kind == '0' || kind == '1') {
            for (const uint8_t byte : data) {
                session.device.receive(static_cast<uint8_t>(kind - '0'), byte, session.now_ms);
            }
        } else if (kind == 't' && data.size() == 4) {
            const uint32_t until_ms = paani::read_u32(data.data());
            while (session.now_ms != until_ms) {
                ++session.now_ms;
                session.step();
            }
        } else if (kind == 'p' && data.size() == 10) {
            session.set_pins(data[0] != 0, data[1], paani::read_u16(&data[2]), paani::read_u16(&data[4]),
                             paani::read_u16(&data[6]), paani::read_i16(&data[8]));
        } else if (kind == '!') {
            volatile const uint8_t* behind = data.data();
            return behind[data.size()];
        } else {
            return 2;
        }
        for (uint8_t line = 0; line < paani::LINES; ++line) {
            uint8_t byte = 0;
            while (session.device.take(line, byte)) {
                sent[line].push_back(byte);
            }
        }
    }
    for (const std::vector<uint8_t>& bytes : sent) {
        fwrite(bytes.data(), 1, bytes.size(), stdout);
    }
    fwrite(session.device.matrix(), 1, paani::MATRIX_BYTES, stdout);
    return 0;
}
