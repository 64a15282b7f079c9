// PAANI on the board's microcontroller. Everything that decides is in src/paani; this carries bytes and pins.
// It was never run on a board: see mcu/README.md.
#include <Arduino.h>
#include <Arduino_LED_Matrix.h>
#include <Arduino_RouterBridge.h>
#include <Servo.h>

#include <vector>

#include "src/paani/device.h"
#include "watchdog.h"

namespace {

#ifdef PAANI_PAPER
constexpr paani::Setting SETTING = paani::PAPER_SETTING;
#else
constexpr paani::Setting SETTING = paani::PAANI_SETTING;
#endif

// Pins. The enable line has a resistor to ground, so that a microcontroller in reset drives nothing.
constexpr int ENABLE_PIN = 4;
constexpr int PULSE_PINS[] = {9, 10};
constexpr int STOP_LOOP_PIN = 7;       // closed to ground: may run; open, or a broken wire: stop
constexpr int RECEIVER_PINS[] = {2, 3, 5};  // left, right, takeover switch
constexpr int BATTERY_PIN = A0;
constexpr int CURRENT_PIN = A1;
constexpr int32_t BATTERY_FULL_MV = 36'300;  // at full scale: a divider of 11 to 1 and 3.3 V
constexpr int32_t CURRENT_FULL_CA = 6'600;   // at full scale: 3.3 V of a sensor with 50 mV for each ampere
constexpr int32_t FULL_SCALE = 1023;

constexpr uint16_t TAKEOVER_US = 1700;       // the switch is on above this
constexpr uint32_t RECEIVER_LOST_MS = 100;   // five frames of 20 ms
constexpr uint32_t RENEW_ROUTES_MS = 10'000;

Arduino_LED_Matrix matrix;
Servo servos[2];
paani::ReadBack pins;
uint32_t accepted_ms = 0;
bool was_accepted = false;

struct Channel {
    volatile uint32_t rise_us, width_us, seen_ms;
};
Channel channels[3];

template <int INDEX>
void measure_pulse() {
    Channel& channel = channels[INDEX];
    if (digitalRead(RECEIVER_PINS[INDEX]) == HIGH) {
        channel.rise_us = micros();
    } else {
        channel.width_us = micros() - channel.rise_us;
        channel.seen_ms = millis();
    }
}

paani::Boot read_boot() {
    const uint32_t flags = watchdog::at(watchdog::RESET_FLAGS);
    watchdog::at(watchdog::RESET_FLAGS) = flags | watchdog::CLEAR_FLAGS;
    paani::ResetCause cause = paani::ResetCause::unknown;
    if ((flags & watchdog::BY_WATCHDOG) != 0) {
        cause = paani::ResetCause::watchdog;
    } else if ((flags & watchdog::BY_SOFTWARE) != 0) {
        cause = paani::ResetCause::software;
    } else if ((flags & watchdog::BY_POWER) != 0) {
        cause = paani::ResetCause::power_on;
    } else if ((flags & watchdog::BY_PIN) != 0) {
        cause = paani::ResetCause::pin;
    }
    return paani::Boot{0, cause};  // the board keeps no count over a reset
}

paani::Device& device() {
    static paani::Device device(SETTING, read_boot());
    return device;
}

// The width of a channel's newest pulse; 0 without one, or where it was too long ago or too long to be one.
uint16_t pulse_us(int index) {
    // An interrupt may measure another pulse at any moment: the clock is looked at last, so no age is negative.
    const uint32_t width_us = channels[index].width_us, seen_ms = channels[index].seen_ms;
    if (static_cast<uint32_t>(millis()) - seen_ms >= RECEIVER_LOST_MS) {
        channels[index].width_us = 0;  // for good: after 49.7 days its time would be of now again
        return 0;
    }
    return width_us > UINT16_MAX ? 0 : static_cast<uint16_t>(width_us);
}

// What a pin measures, of `full` at full scale. `unknown` where the converter fails, which is a number below zero, and at
// the end of its scale, where a wire may be broken and anything may lie beyond.
int32_t measure(int pin, int32_t full, int32_t unknown) {
    const int32_t reading = analogRead(pin);
    return reading >= 0 && reading < FULL_SCALE ? reading * full / FULL_SCALE : unknown;
}

paani::Inputs read_inputs() {
    paani::Inputs inputs;
    inputs.estop = digitalRead(STOP_LOOP_PIN) == HIGH;
    const uint16_t switch_us = pulse_us(2);
    if (switch_us != 0) {
        inputs.receiver = switch_us > TAKEOVER_US ? paani::Receiver::takes_over : paani::Receiver::standby;
        for (int side = 0; side < 2; ++side) {
            inputs.receiver_us[side] = pulse_us(side);
        }
    }
    inputs.battery_mv = static_cast<uint16_t>(measure(BATTERY_PIN, BATTERY_FULL_MV, 0));
    inputs.current_ca = static_cast<int16_t>(measure(CURRENT_PIN, CURRENT_FULL_CA, INT16_MAX));
    return inputs;
}

void set_pins(const paani::Outputs& outputs) {
    digitalWrite(ENABLE_PIN, outputs.enable ? HIGH : LOW);
    for (int side = 0; side < 2; ++side) {
        servos[side].writeMicroseconds(outputs.pulse_us[side]);
        pins.pulse_us[side] = static_cast<uint16_t>(servos[side].readMicroseconds());
    }
    pins.enable = digitalRead(ENABLE_PIN) == HIGH;
}

// `provide_safe` runs these from the loop: bytes in, the verdict on them out, and no other thread touches the core.
std::vector<uint8_t> answer(paani::Method method, const std::vector<uint8_t>& payload) {
    std::vector<uint8_t> status(paani::STATUS_BYTES);
    device().call(method, payload.data(), static_cast<uint32_t>(payload.size()), millis(), status.data());
    if (status[3] == static_cast<uint8_t>(paani::Verdict::accepted)) {
        accepted_ms = millis();
        was_accepted = true;
    }
    return status;
}

std::vector<uint8_t> answer_guide(std::vector<uint8_t> payload) { return answer(paani::Method::guide, payload); }
std::vector<uint8_t> answer_thrust(std::vector<uint8_t> payload) { return answer(paani::Method::thrust, payload); }
std::vector<uint8_t> answer_esc(std::vector<uint8_t> payload) { return answer(paani::Method::esc, payload); }
std::vector<uint8_t> answer_status() { return answer(paani::Method::status, {}); }

}  // namespace

void setup() {
    pinMode(ENABLE_PIN, OUTPUT);
    digitalWrite(ENABLE_PIN, LOW);
    for (int side = 0; side < 2; ++side) {
        servos[side].attach(PULSE_PINS[side]);
    }
    set_pins(paani::Outputs{});
    pinMode(STOP_LOOP_PIN, INPUT_PULLUP);
    for (const int pin : RECEIVER_PINS) {
        pinMode(pin, INPUT);
    }
    attachInterrupt(digitalPinToInterrupt(RECEIVER_PINS[0]), measure_pulse<0>, CHANGE);
    attachInterrupt(digitalPinToInterrupt(RECEIVER_PINS[1]), measure_pulse<1>, CHANGE);
    attachInterrupt(digitalPinToInterrupt(RECEIVER_PINS[2]), measure_pulse<2>, CHANGE);
    matrix.begin();
    matrix.setGrayscaleBits(3);
    device().start(millis());
    set_pins(device().step(read_inputs(), pins, millis()));
    matrix.draw(device().matrix());
    watchdog::start();
    // Without a router this does not return; then the watchdog resets again and again, with the outputs safe throughout.
    Bridge.begin();
    Bridge.provide_safe("paani_guide", answer_guide);
    Bridge.provide_safe("paani_thrust", answer_thrust);
    Bridge.provide_safe("paani_esc", answer_esc);
    Bridge.provide_safe("paani_status", answer_status);
}

void loop() {
    const uint32_t now_ms = millis();
    const paani::Inputs inputs = read_inputs();
    set_pins(device().step(inputs, pins, now_ms));
    if (device().report(pins, now_ms)) {
        for (uint8_t line = 0; line < paani::LINES; ++line) {
            std::vector<uint8_t> status(paani::STATUS_BYTES);
            device().write_status(line, paani::Verdict::none, now_ms, status.data());
            Bridge.notify("paani_mcu", status);
        }
    }
    matrix.draw(device().matrix());
    // A router that was restarted has forgotten the routes, and the library registers them once alone: only a reset does it
    // again. A boat that somebody drives by hand waits with that.
    const bool is_by_hand = inputs.receiver == paani::Receiver::takes_over;
    if (is_by_hand || !was_accepted || now_ms - accepted_ms < RENEW_ROUTES_MS) {
        watchdog::feed();
    }
    delay(1);
}
