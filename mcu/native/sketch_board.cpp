// The sketch on a board of nothing but pins, registers and time, which a script on standard input moves. One line for each
// command: see `main`. Answers go to standard output.
#include <sys/mman.h>

#include <cstdio>
#include <cstdlib>
#include <functional>
#include <iostream>
#include <map>
#include <type_traits>
#include <utility>
#include <sstream>
#include <string>
#include <vector>

#include "../app/sketch/sketch.ino"

namespace {
uint64_t now_us = 1'000'000;
std::map<int, int> levels, modes, analog;
std::map<int, void (*)()> interrupts;
std::map<const Servo*, int> pulses_us;
std::map<std::string, std::function<std::vector<uint8_t>(std::vector<uint8_t>)>> provided;
std::vector<int> edges_after_millis;  // pins that fall a millisecond after the next look at the clock

void set_level(int pin, int level) {
    const bool has_changed = levels[pin] != level;
    levels[pin] = level;
    if (has_changed && interrupts.count(pin) != 0) {
        interrupts[pin]();
    }
}

// The registers that the sketch writes by their addresses.
void map_registers() {
    for (const uintptr_t page : {uintptr_t{0x40003000}, uintptr_t{0x46020000}}) {
        void* place = reinterpret_cast<void*>(page);
        const int flags = MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED_NOREPLACE;
        if (mmap(place, 4096, PROT_READ | PROT_WRITE, flags, -1, 0) != place) {
            std::perror("mmap");
            std::exit(1);
        }
    }
}

void print_state() {
    std::printf("{\"enable\": %d, \"pulses_us\": [%d, %d], \"modes\": {", levels[ENABLE_PIN], pulses_us[&servos[0]],
                pulses_us[&servos[1]]);
    const char* separator = "";
    for (const auto& [pin, mode] : modes) {
        std::printf("%s\"%d\": %d", separator, pin, mode);
        separator = ", ";
    }
    std::printf("}, \"watchdog_ms\": %u, \"key\": %u}\n", watchdog::at(watchdog::RELOAD), watchdog::at(watchdog::KEY));
    watchdog::at(watchdog::KEY) = 0;
}

std::vector<uint8_t> from_hex(const std::string& text) {
    std::vector<uint8_t> bytes;
    for (size_t at = 0; at + 1 < text.size(); at += 2) {
        bytes.push_back(static_cast<uint8_t>(std::stoi(text.substr(at, 2), nullptr, 16)));
    }
    return bytes;
}
}  // namespace

void pinMode(int pin, int mode) { modes[pin] = mode; }
void digitalWrite(int pin, int level) { levels[pin] = level; }
int digitalRead(int pin) { return levels[pin]; }
int analogRead(int pin) { return analog[pin]; }
int digitalPinToInterrupt(int pin) { return pin; }
void attachInterrupt(int number, void (*function)(), int) { interrupts[number] = function; }
unsigned long micros() { return static_cast<uint32_t>(now_us); }
void delay(unsigned long duration_ms) { now_us += 1000 * duration_ms; }
unsigned long millis() {
    const unsigned long now_ms = static_cast<uint32_t>(now_us / 1000);
    const std::vector<int> edges = std::exchange(edges_after_millis, {});
    if (!edges.empty()) {
        now_us += 1000;
        for (const int pin : edges) {
            set_level(pin, LOW);
        }
    }
    return now_ms;
}

void Servo::attach(int) {}
void Servo::writeMicroseconds(int width_us) { pulses_us[this] = width_us; }
int Servo::readMicroseconds() { return pulses_us[this]; }
void Arduino_LED_Matrix::begin() {}
void Arduino_LED_Matrix::setGrayscaleBits(uint8_t) {}
void Arduino_LED_Matrix::draw(const uint8_t*) {}

BridgeStub Bridge;
void BridgeStub::begin() {}
template <typename Function>
bool BridgeStub::provide_safe(const char* name, Function function) {
    provided[name] = [function](std::vector<uint8_t> payload) {
        if constexpr (std::is_invocable_v<Function, std::vector<uint8_t>>) {
            return function(payload);
        } else {
            return function();
        }
    };
    return true;
}
template <typename... Values>
void BridgeStub::notify(const char*, Values...) {}

int main() {
    map_registers();
    std::string line;
    while (std::getline(std::cin, line)) {
        std::istringstream words(line);
        std::string command, name, hex;
        int first = 0, second = 0;
        uint64_t skipped_ms = 0;
        words >> command;
        if (command == "setup") {
            setup();
        } else if (command == "level" && words >> first >> second) {  // of a pin
            set_level(first, second);
        } else if (command == "analog" && words >> first >> second) {  // of a pin
            analog[first] = second;
        } else if (command == "pulse" && words >> first >> second) {  // on a pin, of so many microseconds
            set_level(first, HIGH);
            now_us += static_cast<uint64_t>(second);
            set_level(first, LOW);
        } else if (command == "fall") {  // these pins, just after the loop has looked at the clock
            while (words >> first) {
                edges_after_millis.push_back(first);
            }
        } else if (command == "skip" && words >> skipped_ms) {  // so much time, in which the loop does not turn
            now_us += 1000 * skipped_ms;
        } else if (command == "loop" && words >> first) {  // so many turns
            for (; first > 0; --first) {
                loop();
            }
        } else if (command == "call" && words >> name) {  // of the bridge, with its bytes; prints the answer
            words >> hex;
            for (const uint8_t byte : provided.at(name)(from_hex(hex))) {
                std::printf("%02x", byte);
            }
            std::printf("\n");
        } else if (command == "state") {
            print_state();
        } else {
            std::fprintf(stderr, "no command: %s\n", line.c_str());
            return 2;
        }
    }
    return 0;
}
