// Runs the board's modules on a PC, told by lines on standard input what to do; see rig.py.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <deque>
#include <string>
#include <vector>

#include "board.h"
#include "device.h"
#include "frame.h"
#include "hal_host.h"
#include "played.h"

static bool quiet;
static std::vector<uint8_t> sent;  // to the bus since the direction pin went up
static void check_event(char what, uint8_t value);

static void require(bool good, const char* what) {
    if (good) return;
    fprintf(stderr, "wrong: %s\n", what);
    abort();
}

void played_event(char what, uint8_t value) {
    check_event(what, value);
    if (!quiet) printf("%c %llu %u\n", what, static_cast<unsigned long long>(played_now), value);
}

static std::deque<uint8_t> bytes_of(const char* hex) {
    std::deque<uint8_t> bytes;
    for (; hex[0] && hex[1]; hex += 2) {
        const char pair[3] = {hex[0], hex[1], 0};
        bytes.push_back(static_cast<uint8_t>(strtoul(pair, nullptr, 16)));
    }
    return bytes;
}

static void start() {
    played_restart();
    board_start();
}

static void run_until(uint64_t ticks) {
    try {
        while (played_now < ticks) board_pass();
    } catch (const Reset&) {
        if (!quiet) printf("r %llu 0\n", static_cast<unsigned long long>(played_now));
        sent.clear();
        start();
    }
}

static void parse(const char* hex) {
    Parser parser = Parser();
    for (uint8_t byte : bytes_of(hex)) {
        const uint8_t event = parser_push(parser, byte);
        printf("e %u %u %u %u %u\n", event, parser.id, parser.instruction, frame_length(parser), parser.first);
    }
}

static void stuff(const char* hex, bool back) {
    Stuffing stuffing = Stuffing();
    printf("s ");
    for (uint8_t byte : bytes_of(hex)) {
        if (back) {
            if (!stuffing_drops(stuffing, byte)) printf("%02x", byte);
        } else {
            printf(stuffing_wanted(stuffing, byte) ? "%02xfd" : "%02x", byte);
        }
    }
    printf("\n");
}

// Random traffic ---------------------------------------------------------------------------

static uint64_t seed;
static uint32_t draw(uint32_t below) {
    seed = seed * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<uint32_t>((seed >> 33) % below);
}

static uint16_t crc_of(const std::vector<uint8_t>& bytes) {
    uint16_t crc = 0;
    for (uint8_t byte : bytes) {
        crc ^= static_cast<uint16_t>(byte << 8);
        for (int bit = 0; bit < 8; ++bit) crc = static_cast<uint16_t>((crc << 1) ^ (crc & 0x8000 ? 0x8005 : 0));
    }
    return crc;
}

static std::vector<std::deque<uint8_t> > examples;
static unsigned long long frames_sent;
static unsigned long long rises;  // of wrist ok
static bool safe_when_begun;

static bool overlaps(unsigned begin, unsigned size, unsigned low, unsigned high) { return begin < high && begin + size > low; }

// Whether a frame, less its CRC, may let a servo move: goals and their indirect addresses, torque on, what is not looked into.
static bool may_move(const std::vector<uint8_t>& frame) {
    const uint8_t code = frame[7];
    const size_t count = frame.size() - 8;
    if (code == 0x05 || code == 0x93) return true;
    const bool sync = code == 0x83;
    if ((code != 0x03 && code != 0x04 && !sync) || count < (sync ? 4u : 2u)) return false;
    const unsigned begin = frame[8] | frame[9] << 8;
    const unsigned size = sync ? frame[10] | frame[11] << 8 : static_cast<unsigned>(count - 2);
    if (overlaps(begin, size, 100, 120) || overlaps(begin, size, 224, 252) || overlaps(begin, size, 634, 662)) return true;
    return !sync && begin == 64 && size == 1 && frame[10] != 0;
}

// What goes to the bus must be a whole frame with a right CRC, by the bitwise rule, whatever came in.
static void check_sent() {
    const size_t size = sent.size();
    require(size >= 10 && sent[0] == 0xFF && sent[1] == 0xFF && sent[2] == 0xFD && sent[3] == 0, "header");
    require(size == 7u + sent[5] + (sent[6] << 8), "length");
    require(sent[4] != 200 && sent[4] != 253 && sent[4] != 255, "id");
    const uint16_t crc = static_cast<uint16_t>(sent[size - 2] | sent[size - 1] << 8);
    sent.resize(size - 2);
    require(crc_of(sent) == crc, "CRC");
    require(!safe_when_begun || !may_move(sent), "a goal in the safe state");
    ++frames_sent;
}

static void check_event(char what, uint8_t value) {
    if (!quiet) return;
    require(what != '!', "a byte lost, sent undriven or cut");
    if (what == 'w' && value != 0) {
        ++rises;
        require(table.arm == 1 && table.outputs == 1 && table.faults == 0, "wrist ok on, not armed, not asked for or with a fault");
        require(table.bus_watchdog != 0 && table.bus_watchdog != 255, "wrist ok on without a watchdog");
    }
    if (what == 'b') sent.push_back(value);
    if (what != 'd') return;
    if (value == 0) check_sent();
    safe_when_begun = table.bus_watchdog == 255;
    sent.clear();
}

static uint8_t mutate(uint8_t byte) {
    switch (draw(40)) {
        case 0:
            return static_cast<uint8_t>(draw(256));
        case 1:
            return static_cast<uint8_t>(byte ^ 1 << draw(8));
        default:
            return byte;
    }
}

static uint64_t one_burst(uint64_t& bytes) {
    uint64_t left = 1 + draw(4);
    while (left-- != 0) {
        const std::deque<uint8_t>& example = examples[draw(static_cast<uint32_t>(examples.size()))];
        const bool damaged = draw(2) == 0;
        const bool to_host = draw(3) == 0;
        const size_t cut = draw(12) == 0 ? draw(static_cast<uint32_t>(example.size())) : example.size();
        for (size_t i = 0; i < cut; ++i) {
            const uint8_t byte = damaged ? mutate(example[i]) : example[i];
            if (to_host) played_from_bus(byte);
            else played_from_host(byte);
            ++bytes;
        }
    }
    return played_now + 20 * draw(200);
}

static void fuzz(unsigned long long count) {
    quiet = true;
    uint64_t bytes = 0;
    while (bytes < count) {
        const uint64_t until = one_burst(bytes);
        if (draw(50) == 0) played_pin(static_cast<uint8_t>(1 << draw(3)), draw(2) != 0);
        run_until(until);
        require(table.model_number == BOARD_MODEL && table.id == BOARD_ID, "model or id");
        require(table.protocol_version == BOARD_PROTOCOL, "protocol version");
        require(table.output_state == 0 || table.hindrances == 0, "wrist ok");
    }
    quiet = false;
    printf("f %llu %llu %llu\n", static_cast<unsigned long long>(bytes), frames_sent, rises);
}

// The parser alone: what it calls a frame is one by the bitwise rule, and the other way round.
static void fuzz_parser(unsigned long long count) {
    Parser parser = Parser();
    std::vector<uint8_t> frame;
    unsigned long long found = 0;
    for (unsigned long long i = 0; i < count;) {
        const std::deque<uint8_t>& example = examples[draw(static_cast<uint32_t>(examples.size()))];
        const bool damaged = draw(2) == 0;
        for (uint8_t plain : example) {
            const uint8_t byte = damaged ? mutate(plain) : plain;
            ++i;
            if (parser.at == AT_ID) frame = {0xFF, 0xFF, 0xFD, 0x00};
            if (parser.at >= AT_ID) frame.push_back(byte);
            const uint8_t event = parser_push(parser, byte);
            require(frame.size() <= 1024, "size");
            if (event != EVENT_FRAME && event != EVENT_BAD_CRC) continue;
            const uint16_t crc = static_cast<uint16_t>(frame[frame.size() - 2] | frame[frame.size() - 1] << 8);
            frame.resize(frame.size() - 2);
            require((crc_of(frame) == crc) == (event == EVENT_FRAME), "CRC");
            found += event == EVENT_FRAME;
        }
    }
    printf("f %llu %llu\n", count, found);
}

static void show_table(unsigned address, unsigned size) {
    printf("t ");
    for (unsigned i = address; i < address + size && i < TABLE_SIZE; ++i) printf("%02x", reinterpret_cast<uint8_t*>(&table)[i]);
    printf("\n");
}

static void poke(unsigned address, const char* hex) {
    for (uint8_t byte : bytes_of(hex)) reinterpret_cast<uint8_t*>(&table)[address++] = byte;
}

static void obey(const std::string& word, const char* rest) {
    if (word == "start") start();
    else if (word == "host") for (uint8_t byte : bytes_of(rest)) played_from_host(byte);
    else if (word == "bus") for (uint8_t byte : bytes_of(rest)) played_from_bus(byte);
    else if (word == "reply") played_reply(bytes_of(strchr(rest, ' ') + 1), strtoull(rest, nullptr, 10));
    else if (word == "run") run_until(played_now + strtoull(rest, nullptr, 10));
    else if (word == "low") played_pin(static_cast<uint8_t>(atoi(rest)), false);
    else if (word == "high") played_pin(static_cast<uint8_t>(atoi(rest)), true);
    else if (word == "overrun") played_overrun(atoi(rest) != 0);
    else if (word == "table") show_table(static_cast<unsigned>(atoi(rest)), static_cast<unsigned>(atoi(strchr(rest, ' ') + 1)));
    else if (word == "poke") poke(static_cast<unsigned>(atoi(rest)), strchr(rest, ' ') + 1);
    else if (word == "parse") parse(rest);
    else if (word == "stuff") stuff(rest, false);
    else if (word == "unstuff") stuff(rest, true);
    else if (word == "example") examples.push_back(bytes_of(rest));
    else if (word == "seed") seed = strtoull(rest, nullptr, 10);
    else if (word == "fuzz") fuzz(strtoull(rest, nullptr, 10));
    else if (word == "fuzz_parser") fuzz_parser(strtoull(rest, nullptr, 10));
    else abort();
}

int main() {
    static char line[65536];
    while (fgets(line, sizeof line, stdin)) {
        line[strcspn(line, "\n")] = 0;
        char* space = strchr(line, ' ');
        if (space) *space = 0;
        obey(line, space ? space + 1 : "");
        printf("ok %llu\n", static_cast<unsigned long long>(played_now));
        fflush(stdout);
    }
    return 0;
}
