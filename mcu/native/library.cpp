// The core as a shared library for ctypes, checked for undefined behaviour while it runs. See tests/unit/mcu/core.py.
#include "session.h"

using harness::Session;

extern "C" {

Session* paani_new(int paper, uint32_t now_ms) { return new Session(paper != 0, now_ms); }

void paani_delete(Session* session) { delete session; }

void paani_pins(Session* session, int estop, uint8_t receiver, uint16_t left_us, uint16_t right_us, uint16_t mv,
                int16_t ca) {
    session->set_pins(estop != 0, receiver, left_us, right_us, mv, ca);
}

// Turns of the loop, one each millisecond, up to and with this time.
void paani_run_until(Session* session, uint32_t now_ms) {
    do {
        session->now_ms += session->now_ms == now_ms ? 0 : 1;
        session->step();
    } while (session->now_ms != now_ms);
}

// Time in which the loop does not turn.
void paani_stand_still(Session* session, uint32_t duration_ms) { session->now_ms += duration_ms; }

void paani_receive(Session* session, uint8_t line, const uint8_t* data, uint32_t size) {
    for (uint32_t i = 0; i < size; ++i) {
        session->device.receive(line, data[i], session->now_ms);
    }
}

uint32_t paani_take(Session* session, uint8_t line, uint8_t* data, uint32_t size) {
    uint32_t taken = 0;
    while (taken < size && session->device.take(line, data[taken])) {
        ++taken;
    }
    return taken;
}

void paani_call(Session* session, uint8_t method, const uint8_t* data, uint32_t size, uint8_t* status) {
    session->device.call(static_cast<paani::Method>(method), data, size, session->now_ms, status);
}

void paani_status(Session* session, uint8_t line, uint8_t* status) {
    session->device.write_status(line, paani::Verdict::none, session->now_ms, status);
}

void paani_matrix(Session* session, uint8_t* lights) {
    for (int i = 0; i < paani::MATRIX_BYTES; ++i) {
        lights[i] = session->device.matrix()[i];
    }
}

void paani_disarm(Session* session) { session->device.disarm(); }
}
