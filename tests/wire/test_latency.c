/* SPDX-License-Identifier: MIT */
/* From command to beam: a start, a change and a stop take effect within 100 ms of device time, with a head's default
 * settings. Device time is a property of the program; wall time would be one of the machine. */
#include "tests/wire/room.h"

enum { EFFECT_NS = 100000000 };

static const struct room_config ENDLESS = {.profile = "any-rate",
                                           .prr_hz = 300000,
                                           .lines_hz = 100,
                                           .pan_deg_s = 50,
                                           .pan_stop_deg = 360,
                                           .frames = 0,
                                           .links = LINK_YAML_TCP};

struct session {
    struct wire *wire;
    char journal[352];
    struct head head;
    struct scanhead *sh;
    int commands; /* with effect, so far */
    int64_t scan_t0_ns;
};

static void open_session(struct session *s, struct wire *wire)
{
    *s = (struct session){.wire = wire};
    snprintf(s->journal, sizeof s->journal, "%s", wire_path(wire, "journal"));
    const char *const more[] = {"--journal", s->journal, NULL};
    room_write(wire);
    s->head = head_start(wire, room_config_write(wire, &ENDLESS), more);
    s->sh = client_open(head_endpoint(&s->head, "tcp"));
    client_wait_state(s->sh, "idle");
}

static void close_session(struct session *s)
{
    scanhead_close(s->sh);
    head_end(&s->head, SIGTERM);
}

/* Returns the line after so many commands; NULL: it is not there yet. */
static const char *line_behind(const char *text, int commands)
{
    while (text != NULL && (text[0] == '#' || commands-- > 0)) { /* notes, and the commands before */
        text = strchr(text, '\n');
        text += text != NULL;
    }
    return text != NULL && strchr(text, '\n') != NULL ? text : NULL;
}

static int has_command(const char *text, const void *commands)
{
    return line_behind(text, *(const int *)commands) != NULL;
}

/* Sends a command that has an effect, and returns the device time of its arrival by the journal. The arrival must lie
 * between the head's times before and after. */
static int64_t command(struct session *s, const char *line)
{
    int64_t before_ns = atoll(client_ask(s->sh, "TIME?"));
    client_tell(s->sh, line);
    int64_t after_ns = atoll(client_ask(s->sh, "TIME?"));
    char *text = wire_read_with(s->journal, has_command, &s->commands);
    const char *at = line_behind(text, s->commands);
    s->commands++;
    uint64_t tick;
    int64_t t_ns;
    int session, end = 0;
    assert_int_equal(sscanf(at, "%" SCNu64 " %" SCNd64 " %d %n", &tick, &t_ns, &session, &end), 3);
    assert_int_equal(strncmp(at + end, line, strlen(line)), 0);
    free(text);
    assert_in_range(t_ns, before_ns, after_ns);
    return t_ns;
}

static void next_points(struct session *s, struct scanhead_frame *frame)
{
    do {
        client_next(s->sh, frame);
        if (is_event(frame, SCANHEAD_EV_SCAN_START)) s->scan_t0_ns = (int64_t)frame->event_value[1];
    } while (frame->type != SCANHEAD_POINTS);
}

static int64_t start_scan(struct session *s)
{
    struct scanhead_frame frame;
    int64_t sent_ns = command(s, "SCAN:START");
    next_points(s, &frame);
    assert_true(frame.t_ns > sent_ns);
    return frame.t_ns - sent_ns;
}

static int64_t stop_scan(struct session *s)
{
    struct scanhead_frame frame;
    int64_t sent_ns = command(s, "SCAN:STOP"), last_ns = 0;
    do {
        client_next(s->sh, &frame);
        if (frame.type == SCANHEAD_POINTS) last_ns = frame.t_ns;
    } while (!is_event(&frame, SCANHEAD_EV_SCAN_END));
    client_wait_state(s->sh, "idle");
    return last_ns - sent_ns;
}

static void test_start_and_stop(void **state)
{
    struct session s;
    struct scanhead_frame frame;
    open_session(&s, *state);
    for (int i = 0; i < 5; i++) {
        assert_true(start_scan(&s) <= EFFECT_NS);
        for (int n = 0; n < 7 * i; n++) /* at another place in the line each time */
            next_points(&s, &frame);
        assert_true(stop_scan(&s) <= EFFECT_NS);
    }
    close_session(&s);
}

/* A rate since the last change: a sum of exact periods. A long double holds a second of nanoseconds to 1e-10. */
struct rate {
    int64_t prr_uhz;
    uint64_t pulse0;
    long double t0_ns; /* of pulse0 since the scan's start */
};

static long double time_of(const struct rate *rate, uint64_t pulse)
{
    return rate->t0_ns + (long double)(pulse - rate->pulse0) * 1e15L / (long double)rate->prr_uhz;
}

/* A time on the wire is the exact one, rounded down. From one rate to the next the head carries the fraction of a
 * nanosecond, rounded to a multiple of 1/prr: hence the 1e-6. */
static void check_time(int64_t t_ns, long double exact_ns)
{
    long double rest = exact_ns - (long double)t_ns;
    assert_true(rest > -1e-6L && rest < 1.0L + 1e-6L);
}

static void change(struct session *s, const char *line, double prr_hz, struct rate *rate)
{
    struct scanhead_frame frame;
    struct scanhead_point point[64];
    int64_t sent_ns = command(s, line);
    client_until(s->sh, SCANHEAD_EV_SETTINGS, &frame);
    uint64_t pulse = frame.event_value[0];
    *rate = (struct rate){.prr_uhz = micro(prr_hz), .pulse0 = pulse, .t0_ns = time_of(rate, pulse)};
    int64_t effect_ns = s->scan_t0_ns + (int64_t)rate->t0_ns;
    assert_true(effect_ns > sent_ns && effect_ns - sent_ns <= EFFECT_NS);
    do
        next_points(s, &frame);
    while (frame.pulse0 + frame.n_pulses <= pulse);
    assert_true(frame.pulse0 >= pulse); /* a frame is of the old settings or of the new ones */
    int n = scanhead_points(s->sh, &frame, 0, point, 64);
    assert_true(n > 0);
    for (int i = 0; i < n; i++) /* each firing at the new rate, from the first one on */
        check_time(point[i].t_ns, time_of(rate, frame.pulse0 + (uint64_t)i));
}

static void test_change_in_mid_scan(void **state)
{
    struct session s;
    open_session(&s, *state);
    start_scan(&s);
    struct rate rate = {.prr_uhz = micro(ENDLESS.prr_hz)};
    change(&s, "HEAD:PRR 123456.7", 123456.7, &rate);
    change(&s, "HEAD:LINES 37.5", 123456.7, &rate);
    change(&s, "HEAD:PAN 111", 123456.7, &rate);
    change(&s, "HEAD:PRR 1.2 MHZ", 1200000, &rate);
    change(&s, "SCAN:LINE:STOP 12", 1200000, &rate);
    close_session(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_start_and_stop, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_change_in_mid_scan, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
