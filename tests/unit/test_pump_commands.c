/* SPDX-License-Identifier: MIT */
/* Command lines of a session: in which order they are carried out, when they wait, and what becomes of their replies.
 * The source is this test's: a line's first letter says what it answers. */
#include "tests/unit/session_rig.h"

enum { LONG = COMMAND_MAX_REPLY - 1 }; /* the longest reply */

static int n_overlong, n_refused_lines;
static char refused[64];

static void command(void *self, uint32_t session, const char *line, uint64_t released, struct command_result *out)
{
    (void)self;
    memset(out, 0, sizeof *out);
    if (line[0] == 'L')
        memset(out->reply, 'l', LONG);
    else if (line[0] != 'N')
        snprintf(out->reply, sizeof out->reply, "%u %s %u", session, line, (unsigned)released);
    if (line[0] == 'W') out->error = -1;
    if (line[0] == 'S') out->effect = COMMAND_STEP;
    if (line[0] == 'S') out->step_ns = 3 * TICK_NS;
}

static void overlong(void *self, uint32_t session, struct command_result *out)
{
    (void)self;
    assert_int_equal(session, 3);
    memset(out, 0, sizeof *out);
    strcpy(out->reply, "too long");
    out->error = -1;
    n_overlong++;
}

static void observe_refused(void *ctx, uint32_t session, const char *line, const char *reply)
{
    (void)ctx;
    assert_int_equal(session, 3);
    snprintf(refused, sizeof refused, "%.20s: %.20s", line, reply);
    n_refused_lines++;
}

static void observe_heard(void *ctx, uint32_t session, const void *bytes, size_t len)
{
    (void)ctx, (void)session, (void)bytes, (void)len;
}

static const struct links_observer observer = {.heard = observe_heard, .refused = observe_refused};

static char bytes[READ_BYTES]; /* that the client sends */
static size_t n_bytes;

static ssize_t own_read(void *link, int session, void *buf, size_t len)
{
    const size_t n = n_bytes < len ? n_bytes : len;
    (void)link;
    assert_int_equal(session, 2);
    memcpy(buf, bytes, n);
    n_bytes -= n;
    memmove(bytes, bytes + n, n_bytes);
    return (ssize_t)n;
}

static int setup(void **state)
{
    const int rc = session_setup(state);
    pump.protocol = protocol_ops_get(PROTOCOL_NATIVE);
    own_source.command = command;
    own_source.overlong = overlong;
    own_link.read = own_read;
    links.observer = &observer;
    memset(s, 0, sizeof *s);
    s->id = 3;
    s->reader = 1;
    s->open = 1;
    n_overlong = n_refused_lines = 0;
    n_bytes = 0;
    return rc;
}

static int teardown(void **state)
{
    own_link.read = NULL;
    return session_teardown(state);
}

static void expect_replies(const char *text)
{
    struct session_commands *c = &s->commands;
    assert_int_equal(c->reply_len, strlen(text));
    assert_memory_equal(c->reply, text, c->reply_len);
    c->reply_len = 0;
}

static void lines_are_answered_in_order(void **state)
{
    (void)state;
    release(0);
    say("a\nNothing\nb\r\nhalf");
    pump_take_lines(&pump, s);
    expect_replies("3 a 1\r\n3 b 1\r\n"); /* an empty reply is none */
    assert_true(s->commands.in_pos == s->commands.in_len && n_refused_lines == 0 && s->commands.wrong == 0);
    say(" line\n");
    pump_take_lines(&pump, s);
    expect_replies("3 half line 1\r\n");
}

static void wrong_lines_are_observed(void **state)
{
    (void)state;
    char text[COMMAND_MAX_LINE + 8];
    say("Wrong\nfine\n");
    pump_take_lines(&pump, s);
    expect_replies("3 Wrong 0\r\n3 fine 0\r\n");
    assert_string_equal(refused, "Wrong: 3 Wrong 0");
    assert_true(n_refused_lines == 1 && s->commands.wrong == 1);
    memset(text, 'x', sizeof text);
    strcpy(text + COMMAND_MAX_LINE + 1, "\na\n");
    say(text);
    pump_take_lines(&pump, s);
    expect_replies("too long\r\n3 a 0\r\n");
    assert_true(n_overlong == 1 && n_refused_lines == 2 && s->commands.wrong == 2);
    links.observer = NULL; /* nobody looks */
    say("Wrong\n");
    pump_take_lines(&pump, s);
    assert_int_equal(s->commands.wrong, 3);
}

/* After many wrong lines the rest wait until the link has rested. */
static void a_link_rests_after_wrong_lines(void **state)
{
    (void)state;
    char text[2 * (WRONG_AT_ONCE + 2) + 1];
    for (int i = 0; i < WRONG_AT_ONCE + 2; i++)
        strcpy(text + 2 * i, "W\n");
    say(text);
    pump_take_lines(&pump, s);
    assert_true(n_refused_lines == WRONG_AT_ONCE && s->commands.in_len - s->commands.in_pos == 4);
    assert_int_equal(pump_rest(&pump), 1);
    assert_int_equal(s->commands.wrong, 0);
    pump_take_lines(&pump, s);
    assert_true(n_refused_lines == WRONG_AT_ONCE + 2 && s->commands.in_pos == s->commands.in_len);
    assert_int_equal(pump_rest(&pump), 0);
    s->commands.wrong = WRONG_AT_ONCE; /* of a session that is over */
    s->open = 0;
    assert_int_equal(pump_rest(&pump), 0);
    assert_int_equal(s->commands.wrong, 0);
}

/* A line whose reply may have no room waits. */
static void lines_wait_for_room(void **state)
{
    (void)state;
    struct session_commands *c = &s->commands;
    uint32_t n = 0;
    char text[64] = "";
    while (n + LONG + 2 <= REPLY_ROOM) {
        strcat(text, "L\n");
        n += LONG + 2;
    }
    const uint32_t fits = (uint32_t)strlen(text);
    strcat(text, "a\nb\n");
    say(text);
    pump_take_lines(&pump, s);
    assert_true(c->in_pos == (n + COMMAND_MAX_REPLY + 2 <= REPLY_ROOM ? fits + 2 : fits) && c->replies_dropped == 0);
    c->reply_len = 0;
    pump_take_lines(&pump, s);
    expect_replies("3 a 0\r\n3 b 0\r\n");
}

/* A client that sends on and on without reading loses replies, which is reported. */
static void replies_without_room_are_dropped(void **state)
{
    (void)state;
    struct session_commands *c = &s->commands;
    for (int fits = 0; fits <= 1; fits++) {
        c->reply_len = 0;
        say("L");
        pump_take_lines(&pump, s);
        c->reply_len = REPLY_ROOM - LONG - 1 - (uint32_t)fits; /* without its line end the reply has room */
        memset(bytes, 'a', sizeof bytes);
        bytes[0] = '\n';
        n_bytes = sizeof bytes;
        pump_read_commands(&pump, s, 2);
        expect_log(fits ? "" : "report a client sends without reading its replies; some were dropped|");
        assert_int_equal(c->reply_len, fits ? REPLY_ROOM : REPLY_ROOM - LONG - 1);
        assert_true(c->replies_dropped == 0 && c->in_len - c->in_pos == READ_BYTES - 1); /* the rest waits */
    }
}

/* Lines wait for a step, and no more bytes fit: the link rests, so that it isn't asked over and over. */
static void a_full_input_lets_the_link_rest(void **state)
{
    (void)state;
    s->commands.stepping = 1;
    memset(bytes, 'a', sizeof bytes);
    n_bytes = READ_BYTES - 1;
    pump_read_commands(&pump, s, 2);
    assert_int_equal(s->commands.wrong, 0);
    n_bytes = 5;
    pump_read_commands(&pump, s, 2);
    assert_true(s->commands.wrong == WRONG_AT_ONCE && n_bytes == 4);
}

static void a_step_holds_further_lines(void **state)
{
    (void)state;
    struct session_commands *c = &s->commands;
    stream.steps = stream.waits = 1;
    say("Step\na\n");
    pump_take_lines(&pump, s);
    expect_replies("");
    assert_true(c->stepping == 1 && c->in_len - c->in_pos == 2 && c->step_tick == 3);
    assert_string_equal(c->step_reply, "3 Step 0");
    memcpy(bytes, "b\n", 2);
    n_bytes = 2;
    pump_read_commands(&pump, s, 2); /* more comes meanwhile */
    expect_replies("");
    c->stepping = 0;
    pump_take_lines(&pump, s);
    expect_replies("3 a 0\r\n3 b 0\r\n");
}

#define WITH_SESSION(test) cmocka_unit_test_setup_teardown(test, setup, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        WITH_SESSION(lines_are_answered_in_order),      WITH_SESSION(wrong_lines_are_observed),
        WITH_SESSION(a_link_rests_after_wrong_lines),   WITH_SESSION(lines_wait_for_room),
        WITH_SESSION(replies_without_room_are_dropped), WITH_SESSION(a_step_holds_further_lines),
        WITH_SESSION(a_full_input_lets_the_link_rest),
    };
    return cmocka_run_group_tests_name("command lines of a session", tests, NULL, NULL);
}
