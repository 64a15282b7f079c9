// Declarations for checking the sketch's syntax; no board's library.
#pragma once

struct BridgeStub {
    void begin();
    template <typename Function>
    bool provide_safe(const char* name, Function function);
    template <typename... Values>
    void notify(const char* name, Values... values);
};
extern BridgeStub Bridge;
