/* SPDX-License-Identifier: MIT */
#include "tests/unit/scip_rig.h"

struct protocol_rig rig;
struct protocol_rig_shot shot[SCIP_STEPS];

int scip_teardown(void **state)
{
    (void)state;
    if (rig.protocol != NULL) protocol_rig_close(&rig);
    return 0;
}

void scip_open_head(const char *model, uint32_t steps, int first, int last, int front, int turn, uint32_t lines_hz)
{
    scip_teardown(NULL);
    protocol_rig_open(&rig, PROTOCOL_SCIP, "Hokuyo", model);
    protocol_rig_planar(&rig, steps, first, last, front, turn, lines_hz);
    scip_flat(1.0);
}

void scip_open(const char *model)
{
    if (strcmp(model, "URG-04LX") == 0) {
        scip_open_head(model, 1024, 44, 725, 384, -1, 10);
        rig.descriptor.range_min_m = 0.02;
        rig.descriptor.range_max_m = 5.6;
    } else {
        scip_open_head(model, 1440, 0, 1080, 540, -1, 40);
    }
    protocol_rig_describe(&rig, 0);
}

void scip_expect(const char *answer)
{
    rig.bytes[rig.len] = 0;
    assert_string_equal((const char *)rig.bytes, answer);
    assert_int_equal(rig.len, strlen(answer));
    protocol_rig_clear(&rig);
}

void scip_ask(const char *lines, const char *answer)
{
    protocol_rig_input(&rig, lines);
    scip_expect(answer);
}

void scip_expect_in(const char *line, const char *const *pieces)
{
    protocol_rig_clear(&rig);
    protocol_rig_input(&rig, line);
    rig.bytes[rig.len] = 0;
    for (; *pieces != NULL; pieces++)
        if (strstr((char *)rig.bytes, *pieces) == NULL) fail_msg("%s: no %s in %s", line, *pieces, (char *)rig.bytes);
    protocol_rig_clear(&rig);
}

void scip_flat(double range_m)
{
    for (int i = 0; i < SCIP_STEPS; i++)
        shot[i] = (struct protocol_rig_shot){.n = 1, .range_m = {range_m}};
}

void scip_turn(uint32_t line)
{
    protocol_rig_turn(&rig, line, shot, 100);
}

/* Frames have at most 150 points, so firing times within a frame are below 2^24 ns. */
void scip_part(uint32_t line, int from, int to)
{
    for (; from <= to; from += 150)
        protocol_rig_part(&rig, line, (uint32_t)from, to - from < 150 ? (uint32_t)(to - from) + 1 : 150, shot + from);
}

void scip_line_end(uint32_t line, uint32_t status)
{
    rig.ops->time(rig.protocol, protocol_rig_turn_end(&rig, line, status));
}

/* Reads one line, whose last character is the sum of those before it. Returns how many those are. */
static size_t summed_line(const char **at, char line[80])
{
    const size_t len = strcspn(*at, "\n");
    unsigned sum = 0;
    assert_in_range(len, 2, 65);
    assert_int_equal((*at)[len], '\n');
    for (size_t i = 0; i + 1 < len; i++)
        sum += (unsigned char)(*at)[i];
    assert_int_equal((*at)[len - 1], sum % 64 + '0');
    memcpy(line, *at, len - 1);
    *at += len + 1;
    return len - 1;
}

static uint32_t number(const char *text, int n_chars)
{
    uint32_t value = 0;
    for (int i = 0; i < n_chars; i++)
        value = value * 64 + (uint32_t)(text[i] - '0');
    return value;
}

void scip_decode(struct scip_decoded *scan, const char **at, int n_chars, int intensity)
{
    static char data[1 << 17];
    char line[80];
    size_t len = 0, i = 0;
    memset(scan, 0, sizeof *scan);
    const size_t n_echo = strcspn(*at, "\n");
    assert_in_range(n_echo, 2, 79);
    memcpy(scan->echo, *at, n_echo);
    *at += n_echo + 1;
    assert_int_equal(summed_line(at, line), 2);
    memcpy(scan->status, line, 2);
    assert_int_equal(summed_line(at, line), 4);
    scan->time_ms = number(line, 4);
    for (; **at != '\n' && **at != 0; len += summed_line(at, data + len))
        assert_in_range(len, 0, sizeof data - 80);
    assert_int_equal(*(*at)++, '\n');
    while (i < len) {
        const int more = data[i] == '&';
        const uint32_t k = more ? scan->n[scan->n_steps - 1]++ : 0;
        i += (size_t)more;
        if (!more) scan->n[scan->n_steps++] = 1;
        assert_true(k < 3 && scan->n_steps <= SCIP_STEPS && i + (size_t)n_chars + 3 * (size_t)intensity <= len);
        scan->range_mm[scan->n_steps - 1][k] = number(data + i, n_chars);
        i += (size_t)n_chars;
        if (intensity) scan->intensity[scan->n_steps - 1][k] = number(data + i, 3);
        i += 3 * (size_t)intensity;
    }
}

void scip_decode_only(struct scip_decoded *scan, int n_chars, int intensity)
{
    rig.bytes[rig.len] = 0;
    const char *at = (const char *)rig.bytes;
    scip_decode(scan, &at, n_chars, intensity);
    assert_ptr_equal(at, rig.bytes + rig.len);
    protocol_rig_clear(&rig);
}
