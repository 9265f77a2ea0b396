/* SPDX-License-Identifier: MIT */
/* Tells apart the messages of a captured conversation (talk.h) in the protocols that are known here: CoLa, SCIP and
 * lines. */
#include <stdio.h>
#include <string.h>

#include "core/bytes.h"
#include "drivers/protocol/protocol.h"
#include "drivers/protocol/talk.h"

/* ---- SICK CoLa: 02 ... 03, or 02 02 02 02, u32 length, the telegram and its check byte (COLA.md) */

enum { STX = 2, ETX = 3, COLA_B_HEAD = 8, COLA_MOST = 1 << 20 };

struct telegram {
    const char *text;
    size_t len;
};

static size_t cola_len(const uint8_t *bytes, size_t len)
{
    static const uint8_t marks[4] = {STX, STX, STX, STX};
    if (bytes[0] != STX) {
        const uint8_t *next = memchr(bytes, STX, len);
        return next != NULL ? (size_t)(next - bytes) : len;
    }
    if (len < sizeof marks && memcmp(bytes, marks, len) == 0) return 0;
    if (memcmp(bytes, marks, sizeof marks) == 0) {
        if (len < COLA_B_HEAD) return 0;
        const uint32_t n = be_get32(bytes + 4);
        if (n > COLA_MOST) return 1; /* this is no telegram */
        return len >= COLA_B_HEAD + (size_t)n + 1 ? COLA_B_HEAD + (size_t)n + 1 : 0;
    }
    const uint8_t *end = memchr(bytes, ETX, len);
    return end != NULL ? (size_t)(end - bytes) + 1 : 0;
}

/* A telegram without its marks. */
static struct telegram cola_inside(const uint8_t *bytes, size_t len)
{
    const size_t head = len > COLA_B_HEAD && bytes[1] == STX ? (size_t)COLA_B_HEAD : 1;
    if (len <= head + 1) return (struct telegram){"", 0};
    return (struct telegram){(const char *)bytes + head, len - head - 1};
}

/* The first n words, with the blank between them. */
static size_t words_len(const struct telegram *t, int n)
{
    size_t i = 0;
    while (i < t->len && (t->text[i] != ' ' || --n > 0))
        i++;
    return i;
}

/* "sRN name" is answered by "sRA name", and any request by "sFA". */
static int cola_answers(const uint8_t *request, size_t request_len, const uint8_t *message, size_t len)
{
    static const char *const verbs[][2] = {
        {"sRN", "sRA"}, {"sRI", "sRA"}, {"sWN", "sWA"}, {"sMN", "sAN"}, {"sEN", "sEA"}};
    const struct telegram asked = cola_inside(request, request_len), said = cola_inside(message, len);
    if (asked.len < 3 || said.len < 3) return 0;
    if (memcmp(said.text, "sFA", 3) == 0) return 1;
    for (size_t i = 0; i < sizeof verbs / sizeof *verbs; i++) {
        if (memcmp(asked.text, verbs[i][0], 3) != 0 || memcmp(said.text, verbs[i][1], 3) != 0) continue;
        const size_t n = words_len(&asked, 2);
        if (i == 1) return 1; /* variables by number */
        return words_len(&said, 2) == n && memcmp(asked.text + 3, said.text + 3, n - 3) == 0;
    }
    return 0;
}

/* Whether the telegram is "sEN name 1" (on 1) or "sEN name 0" (on 0). */
static int is_event(const struct telegram *t, int on)
{
    const size_t n = words_len(t, 2);
    if (t->len != n + 2 || memcmp(t->text, "sEN ", 4) != 0) return 0;
    return (t->text[n + 1] & 1) == on; /* 0 or 1 as a digit or as a byte */
}

/* Whether the telegram's first two words are these, such as "sMN LMCstopmeas". */
static int begins(const struct telegram *t, const char *words)
{
    const size_t n = strlen(words);
    return words_len(t, 2) == n && memcmp(t->text, words, n) == 0;
}

/* "sEN name 1" begins the stream of "sSN name". LMCstartmeas, too, begins the stream of scans (COLA.md). */
static int cola_streams(const uint8_t *request, size_t request_len, const uint8_t *message, size_t len)
{
    const struct telegram asked = cola_inside(request, request_len), said = cola_inside(message, len);
    const size_t n = words_len(&said, 2);
    if (begins(&asked, "sMN LMCstartmeas")) return begins(&said, "sSN LMDscandata");
    return is_event(&asked, 1) && n > 4 && memcmp(said.text, "sSN ", 4) == 0 && words_len(&asked, 2) == n &&
           memcmp(asked.text + 3, said.text + 3, n - 3) == 0;
}

static int cola_stops(const uint8_t *request, size_t len, const uint8_t *began, size_t began_len)
{
    const struct telegram now = cola_inside(request, len), then = cola_inside(began, began_len);
    const int is_start = begins(&then, "sMN LMCstartmeas");
    const int is_scans = is_start || begins(&then, "sEN LMDscandata");
    if (!is_start && !is_event(&then, 1)) return 0;
    if (begins(&now, "sMN mSCreboot")) return 1;
    if (begins(&now, "sMN LMCstopmeas") || begins(&now, "sMN LMCstandby")) return is_scans;
    if (!is_event(&now, 0) && !is_event(&now, 1)) return 0;
    if (is_start) return begins(&now, "sEN LMDscandata");
    const size_t n = words_len(&now, 2);
    return words_len(&then, 2) == n && memcmp(now.text, then.text, n) == 0;
}

/* Writes sFA with the error of an unknown variable, method or event. */
static size_t cola_error(const uint8_t *request, size_t len, uint8_t *to)
{
    const struct telegram t = cola_inside(request, len);
    const char verb = t.len > 1 ? t.text[1] : 'R';
    const uint8_t code = verb == 'M' ? 2 : verb == 'E' ? 15 : 3;
    if (len < 2 || request[1] != STX) return (size_t)sprintf((char *)to, "\x02sFA %X\x03", code);
    static const uint8_t head[COLA_B_HEAD] = {STX, STX, STX, STX, 0, 0, 0, 5};
    memcpy(to, head, sizeof head);
    memcpy(to + COLA_B_HEAD, (const uint8_t[]){'s', 'F', 'A', 0, code, 0}, 6);
    to[COLA_B_HEAD + 5] = protocol_xor(to + COLA_B_HEAD, 5);
    return COLA_B_HEAD + 6;
}

static const struct talk_kind talk_cola = {.name = "CoLa",
                                           .request_len = cola_len,
                                           .answer_len = cola_len,
                                           .answers = cola_answers,
                                           .streams = cola_streams,
                                           .stops = cola_stops,
                                           .error = cola_error,
                                           .n_words = 2};

/* ---- lines */

static size_t line_len(const uint8_t *bytes, size_t len)
{
    const uint8_t *end = memchr(bytes, '\n', len);
    return end != NULL ? (size_t)(end - bytes) + 1 : 0;
}

static const struct talk_kind talk_lines = {.name = "lines", .request_len = line_len, .n_words = 1};
const struct talk_kind talk_bytes = {.name = "bytes"};

/* ---- Hokuyo SCIP: a line, and an answer that begins with it and ends with an empty line (SCIP.md) */

static size_t scip_answer_len(const uint8_t *bytes, size_t len)
{
    for (size_t i = 1; i < len; i++)
        if (bytes[i] == '\n' && bytes[i - 1] == '\n') return i + 1;
    return 0;
}

/* Length of the first line, without its end. */
static size_t scip_line(const uint8_t *bytes, size_t len)
{
    size_t n = 0;
    while (n < len && bytes[n] != '\n' && bytes[n] != '\r')
        n++;
    return n;
}

static size_t scip_request_len(const uint8_t *bytes, size_t len)
{
    const size_t n = scip_line(bytes, len);
    return n < len ? n + 1 : 0;
}

static int is_scan(const uint8_t *message, size_t len)
{
    const size_t n = scip_line(message, len);
    return len >= n + 3 && memcmp(message + n + 1, "99", 2) == 0;
}

static int scip_answers(const uint8_t *request, size_t request_len, const uint8_t *message, size_t len)
{
    const size_t n = scip_line(request, request_len);
    return n != 0 && n == scip_line(message, len) && memcmp(request, message, n) == 0 && !is_scan(message, len);
}

/* Where the two digits stand that count scans; 0: the request begins no stream. */
static size_t scip_count_at(const uint8_t *request, size_t len)
{
    const size_t mark = len != 0 && request[0] == '%';
    if (len < mark + 15 || memchr("MN", request[mark], 2) == NULL || memchr("DSE", request[mark + 1], 3) == NULL)
        return 0;
    return mark + 13;
}

static int scip_streams(const uint8_t *request, size_t request_len, const uint8_t *message, size_t len)
{
    const size_t at = scip_count_at(request, request_len), n = scip_line(request, request_len);
    return at != 0 && n >= at + 2 && n == scip_line(message, len) && is_scan(message, len) &&
           memcmp(request, message, at) == 0 && memcmp(request + at + 2, message + at + 2, n - at - 2) == 0;
}

static int scip_stops(const uint8_t *request, size_t len, const uint8_t *began, size_t began_len)
{
    static const char *const enders[] = {"QT", "RS", "RT", "RB", "TM0", "%SL"};
    if (scip_count_at(began, began_len) == 0) return 0;
    for (size_t i = 0; i < sizeof enders / sizeof *enders; i++)
        if (len > strlen(enders[i]) && memcmp(request, enders[i], strlen(enders[i])) == 0) return 1;
    return scip_count_at(request, len) != 0;
}

/* Repeats the request, and adds 0E with its checksum: the command is not known. */
static size_t scip_error(const uint8_t *request, size_t len, uint8_t *to)
{
    static const char status[] = "\n0Ee\n\n"; /* ('0' + 'E') & 0x3f, and 0x30 more */
    size_t n = scip_line(request, len);
    if (n > 32) n = 32;
    memcpy(to, request, n);
    memcpy(to + n, status, sizeof status - 1);
    return n + sizeof status - 1;
}

static const struct talk_kind talk_scip = {.name = "SCIP",
                                           .request_len = scip_request_len,
                                           .answer_len = scip_answer_len,
                                           .answers = scip_answers,
                                           .streams = scip_streams,
                                           .stops = scip_stops,
                                           .error = scip_error,
                                           .n_words = 1};

/* ---- which protocol a connection speaks */

/* Two letters alone are no proof. A digit must follow the name, or after a command without digits the line's end or a
 * semicolon. */
static int is_scip(const uint8_t *bytes, size_t len)
{
    static const char *const bare[] = {"VV", "PP", "II", "BM", "QT", "RS", "RT", "RB", "%SL", "%ST", "SCIP2.0"};
    static const char *const counted[] = {"TM", "SS", "CR", "HS", "DB", "GD", "GS", "GE",
                                          "MD", "MS", "ME", "HD", "HE", "ND", "NE"};
    for (size_t i = 0; i < sizeof bare / sizeof *bare; i++) {
        const size_t n = strlen(bare[i]);
        if (len > n && memcmp(bytes, bare[i], n) == 0 && memchr("\n\r;", bytes[n], 3) != NULL) return 1;
    }
    if (len != 0 && bytes[0] == '%') bytes++, len--;
    for (size_t i = 0; i < sizeof counted / sizeof *counted; i++)
        if (len > 2 && memcmp(bytes, counted[i], 2) == 0 && bytes[2] >= '0' && bytes[2] <= '9') return 1;
    return 0;
}

/* Several lines of HTTP are one request. So a connection that begins with HTTP must not be taken for one of lines. */
static int is_http(const uint8_t *bytes, size_t len)
{
    static const char version[] = " HTTP/1.";
    for (size_t i = 0; i + sizeof version <= len && bytes[i] != '\n'; i++)
        if (memcmp(bytes + i, version, sizeof version - 1) == 0) return 1;
    return 0;
}

const struct talk_kind *talk_kind_of(const uint8_t *bytes, size_t len)
{
    const size_t line = line_len(bytes, len);
    if (len >= 2 && bytes[0] == STX && (bytes[1] == 's' || bytes[1] == STX)) return &talk_cola;
    if (is_http(bytes, len)) return &talk_bytes;
    if (is_scip(bytes, len) && scip_request_len(bytes, len) != 0) return &talk_scip;
    if (line == 0) return &talk_bytes;
    for (size_t i = 0; i < line; i++)
        if ((bytes[i] < 0x20 || bytes[i] > 0x7e) && memchr("\t\r\n", bytes[i], 3) == NULL) return &talk_bytes;
    return &talk_lines;
}

void talk_name(const struct talk_kind *kind, const uint8_t *request, size_t len, char name[TALK_NAME_LEN])
{
    struct telegram t = {(const char *)request, len};
    if (kind == &talk_cola) t = cola_inside(request, len);
    size_t n = kind == &talk_scip ? 2 + (size_t)(len != 0 && request[0] == '%') : words_len(&t, kind->n_words);
    const size_t line = scip_line((const uint8_t *)t.text, t.len);
    if (kind->n_words != 0) {
        snprintf(name, TALK_NAME_LEN, "%.*s", (int)(n < line ? n : line), t.text);
        return;
    }
    name[0] = '\0';
    for (size_t i = 0; i < len && i < 8; i++)
        snprintf(name + 3 * i, TALK_NAME_LEN - 3 * i, "%02x ", request[i]);
}
