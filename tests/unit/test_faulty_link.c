/* SPDX-License-Identifier: MIT */
/* A link with injected faults around a link of the test's own: which calls reach the inner one, how long it may wait,
 * and what the person who runs the head is told. Waits are of an hour, so that no machine is too slow for them. */
#include "firmware_sim/fault/faulty_inside.h"
#include "tests/unit/wire_rig.h"

static const double HOUR_MS = 3600000.0;
enum { TAKES_ALL = -1000, ROOM = 4096, MOST_MS = 60000 /* that a link waits before it looks again */ };

/* The inner link. */
static struct inner {
    int rc;    /* of fault() */
    ssize_t n; /* of write(); TAKES_ALL: what it is given */
    int timeout_ms, n_faults, n_events, closed;
    uint32_t want_write;
    struct {
        enum link_fault what;
        int session;
        uint32_t n;
        double for_ms;
    } fault[16];
    struct link_event event[4]; /* of the next poll() */
    char out[256];
    size_t n_out;
} inner;

static int inner_poll(void *link, int wake_fd, uint32_t want_write, int timeout_ms, struct link_event *events, int max)
{
    const int n = inner.n_events;
    assert_true(link == &inner && wake_fd == 77 && n <= max);
    inner.timeout_ms = timeout_ms;
    inner.want_write = want_write;
    memcpy(events, inner.event, (size_t)n * sizeof *events);
    inner.n_events = 0;
    return n;
}

static ssize_t inner_write(void *link, int session, const void *buf, size_t len)
{
    (void)link;
    (void)session;
    if (inner.n != TAKES_ALL) return inner.n;
    assert_true(inner.n_out + len <= sizeof inner.out);
    memcpy(inner.out + inner.n_out, buf, len);
    inner.n_out += len;
    return (ssize_t)len;
}

static int inner_fault(void *link, enum link_fault what, int session, uint32_t n, double for_ms)
{
    (void)link;
    assert_true(inner.n_faults < 16);
    inner.fault[inner.n_faults].what = what;
    inner.fault[inner.n_faults].session = session;
    inner.fault[inner.n_faults].n = n;
    inner.fault[inner.n_faults++].for_ms = for_ms;
    return inner.rc;
}

static void inner_close(void *link)
{
    (void)link;
    inner.closed++;
}

static const struct link_ops inner_ops = {
    .name = "inner", .poll = inner_poll, .write = inner_write, .fault = inner_fault, .close = inner_close};

static void expect_fault(int i, enum link_fault what, int session, uint32_t n, double for_ms)
{
    assert_true(i < inner.n_faults);
    assert_int_equal(inner.fault[i].what, what);
    assert_int_equal(inner.fault[i].session, session);
    assert_int_equal(inner.fault[i].n, n);
    assert_true(inner.fault[i].for_ms == for_ms);
}

/* The owner. */
static struct {
    int64_t now_ns;
    int is_off, n_said;
    char said[160];
} owner;

static int64_t owner_time_ns(void *self)
{
    (void)self;
    return owner.now_ns;
}

static int owner_is_off(void *self)
{
    (void)self;
    return owner.is_off;
}

static void owner_say(void *self, const char *text)
{
    (void)self;
    owner.n_said++;
    snprintf(owner.said, sizeof owner.said, "%s", text);
}

static struct fault_board *board;
static struct fault_note note[16];
static int n_notes;

static void keep_note(void *ctx, const struct fault_note *noted)
{
    (void)ctx;
    assert_true(n_notes < 16);
    note[n_notes++] = *noted;
}

/* Opens it with these faults, for sessions 11 and on of link 3. */
static struct faulty_link *open_with(const struct fault *fault, uint32_t n)
{
    struct fault_list list = {.n = n};
    struct sh_err err;
    struct faulty_link *f = NULL;
    memset(&inner, 0, sizeof inner);
    memset(&owner, 0, sizeof owner);
    inner.n = TAKES_ALL;
    owner.now_ns = 5000;
    n_notes = 0;
    if (n > 0) memcpy(list.fault, fault, n * sizeof *fault);
    assert_int_equal(fault_board_create(&list, NULL, NULL, &board, &err), SH_OK);
    fault_board_listen(board, keep_note, NULL);
    const struct faulty_spec spec = {.board = board,
                                     .number = 3,
                                     .first_session = 11,
                                     .protocol = protocol_ops_get(PROTOCOL_SCIP),
                                     .room = ROOM,
                                     .time_ns = owner_time_ns,
                                     .is_off = owner_is_off,
                                     .say = owner_say};
    const struct link_spec null = {.type = LINK_NULL};
    assert_int_equal(faulty_open(&spec, &null, &f, &err), SH_OK);
    f->inner->close(f->link);
    f->inner = &inner_ops;
    f->link = &inner;
    f->can = LINK_FAULT_BIT(LINK_FAULT_PLUG) - 1;
    return f;
}

static void close_it(struct faulty_link *f)
{
    faulty_ops(f)->close(f);
    assert_int_equal(inner.closed, 1);
    fault_board_free(board);
}

static int poll_it(struct faulty_link *f, uint32_t want_write, int timeout_ms, struct link_event *events)
{
    return faulty_ops(f)->poll(f, 77, want_write, timeout_ms, events, 4);
}

static ssize_t write_it(struct faulty_link *f, int session, const char *text)
{
    faulty_next(f, session, 0, owner.now_ns);
    return faulty_ops(f)->write(f, session, text, strlen(text));
}

static void without_faults_calls_pass_through(void **state)
{
    (void)state;
    struct link_event events[4];
    struct faulty_link *f = open_with(NULL, 0);
    assert_true(!faulty_is_on(f) && faulty_look(f, 0).moved_ns == 0);
    inner.n = 0;
    assert_int_equal(write_it(f, 0, "abc"), 0);
    assert_true(faulty_look(f, 0).moved_ns == 0); /* it took none */
    inner.n = 2;
    assert_int_equal(write_it(f, 0, "abc"), 2);
    assert_true(faulty_look(f, 0).moved_ns > 0 && !faulty_look(f, 0).waits && !faulty_look(f, 0).keeps_back);
    inner.n = SH_ECLOSED;
    assert_int_equal(write_it(f, 0, "c"), SH_ECLOSED);
    assert_int_equal(faulty_pass(f, 0, INT64_MAX), 1);
    for (int ms = -1; ms < 2; ms++) {
        assert_int_equal(poll_it(f, 5, ms, events), 0);
        assert_true(inner.timeout_ms == ms && inner.want_write == 5);
    }
    close_it(f);
}

/* Bytes that a fault holds back do not wait for the inner link. If it takes nothing, it is not asked again at once. */
static void a_stall_ends_the_wait(void **state)
{
    (void)state;
    struct link_event events[4];
    struct fault stall = fault_of_kind(FAULT_STALL);
    stall.at = 2;
    stall.for_ms = HOUR_MS;
    struct faulty_link *f = open_with(&stall, 1);
    assert_int_equal(write_it(f, 1, "a\n\n"), 3);
    assert_int_equal(faulty_pass(f, 1, owner.now_ns), 1);
    assert_int_equal(poll_it(f, 7, -1, events), 0);
    assert_true(inner.timeout_ms == -1 && inner.want_write == 5); /* nothing waits */
    assert_int_equal(write_it(f, 1, "b\n\n"), 3);
    faulty_pass(f, 1, owner.now_ns);
    assert_true(inner.n_out == 3 && memcmp(inner.out, "a\n\n", 3) == 0);
    assert_true(faulty_look(f, 1).waits && faulty_look(f, 1).keeps_back);
    poll_it(f, 7, -1, events);
    assert_true(inner.timeout_ms == MOST_MS && inner.want_write == 5);
    poll_it(f, 7, MOST_MS - 1, events);
    assert_int_equal(inner.timeout_ms, MOST_MS - 1);
    assert_true(faulty_forget(f, 1).frames == 1 && faulty_forget(f, 1).frames == 0);
    inner.n = 0; /* takes nothing */
    assert_int_equal(write_it(f, 2, "c\n\n"), 3);
    assert_int_equal(faulty_pass(f, 2, owner.now_ns), 0);
    poll_it(f, 7, -1, events);
    assert_true(inner.timeout_ms == -1 && inner.want_write == 7);
    assert_true(faulty_look(f, 2).waits && !faulty_look(f, 2).keeps_back);
    close_it(f);
}

/* A writer to a session that the fault has ended learns of it. The endpoint may be taken meanwhile. */
static void an_unplugged_link_comes_back(void **state)
{
    (void)state;
    struct link_event events[4];
    struct fault unplug = fault_of_kind(FAULT_UNPLUG);
    unplug.at = unplug.count = 1;
    unplug.for_ms = HOUR_MS;
    struct faulty_link *f = open_with(&unplug, 1);
    write_it(f, 1, "a\n\n");
    assert_int_equal(faulty_pass(f, 1, owner.now_ns), SH_ECLOSED);
    expect_fault(0, LINK_FAULT_UNPLUG, 1, fault_n(&unplug), HOUR_MS);
    assert_true(n_notes == 1 && note[0].kind == FAULT_UNPLUG && note[0].session == 12 && inner.n_out == 0);
    poll_it(f, 0, -1, events);
    assert_int_equal(inner.timeout_ms, 0); /* its owner closes the session after this poll */
    for (int i = 0; i < LINK_MAX_SESSIONS; i++) {
        assert_true(f->session[i].is_gone);
        faulty_forget(f, i);
    }
    poll_it(f, 0, -1, events);
    assert_true(inner.timeout_ms == MOST_MS && inner.n_faults == 1);
    inner.rc = SH_ESTATE; /* somebody else has the endpoint */
    const struct link_ops *ops = faulty_ops(f);
    assert_int_equal(faulty_fault(f, LINK_FAULT_PLUG, 0, 0, 0.0), SH_ESTATE);
    assert_int_equal(faulty_fault(f, LINK_FAULT_PLUG, 0, 0, 0.0), SH_ESTATE);
    assert_true(owner.n_said == 1);
    assert_string_equal(owner.said,
                        "was unplugged on request, and somebody else has its endpoint now; tries until it is "
                        "free");
    inner.rc = SH_OK;
    assert_int_equal(faulty_fault(f, LINK_FAULT_PLUG, 0, 0, 0.0), SH_OK);
    assert_true(owner.n_said == 2);
    assert_string_equal(owner.said, "is there again");
    assert_int_equal(faulty_fault(f, LINK_FAULT_PLUG, 0, 0, 0.0), SH_OK);
    assert_true(owner.n_said == 2); /* it was there */
    expect_fault(4, LINK_FAULT_PLUG, 0, 0, 0.0);
    inner.event[0] = (struct link_event){.kind = LINK_OPENED, .session = 1};
    inner.n_events = 1;
    f->session[1].is_gone = 1;
    assert_int_equal(ops->poll(f, 77, 0, -1, events, 4), 1);
    assert_int_equal(write_it(f, 1, "b\n\n"), 3);
    assert_int_equal(faulty_pass(f, 1, owner.now_ns), 1);
    assert_int_equal(inner.n_out, 3);
    close_it(f);
}

/* A failed act does not count, and the session goes on. */
static void an_act_that_fails_is_told(void **state)
{
    (void)state;
    struct fault end = fault_of_kind(FAULT_DISCONNECT);
    end.count = 1;
    struct faulty_link *f = open_with(&end, 1);
    inner.rc = SH_ESTATE;
    write_it(f, 1, "a\n\n");
    assert_int_equal(faulty_pass(f, 1, owner.now_ns), 1);
    assert_true(owner.n_said == 1 && n_notes == 0);
    assert_string_equal(owner.said, "the fault disconnect could not be carried out now");
    inner.rc = SH_OK;
    write_it(f, 1, "b\n\n");
    assert_int_equal(faulty_pass(f, 1, owner.now_ns), SH_ECLOSED);
    expect_fault(1, LINK_FAULT_DISCONNECT, 1, fault_n(&end), 0.0);
    assert_true(n_notes == 1 && owner.n_said == 1 && fault_board_injected(board, 1) == 1);
    assert_true(f->session[1].is_gone && !f->session[0].is_gone && !f->session[2].is_gone);
    write_it(f, 2, "c\n\n"); /* the count holds for the link */
    assert_int_equal(faulty_pass(f, 2, owner.now_ns), 1);
    close_it(f);
}

/* A fault that strikes in two sessions pulls the one cable once. The truth has the begin and the end of the pull. */
static void a_cable_is_pulled_once(void **state)
{
    (void)state;
    struct fault cable = fault_of_kind(FAULT_CABLE);
    cable.at = 1;
    cable.for_ms = HOUR_MS;
    cable.reset = 1;
    struct faulty_link *f = open_with(&cable, 1);
    write_it(f, 1, "a\n\n");
    faulty_pass(f, 1, owner.now_ns);
    write_it(f, 2, "b\n\n");
    faulty_pass(f, 2, owner.now_ns);
    assert_true(inner.n_faults == 1 && n_notes == 1 && faulty_is_pulled(f) && !f->session[1].is_gone);
    assert_true(note[0].fault == 1 && note[0].kind == FAULT_CABLE && note[0].t_ns == 5000 && !note[0].ended);
    owner.now_ns = 9000;
    assert_int_equal(faulty_fault(f, LINK_FAULT_PLUG, 0, 0, 0.0), SH_OK);
    expect_fault(1, LINK_FAULT_PLUG, 0, 1, 0.0); /* and resets what was connected */
    assert_true(n_notes == 2 && note[1].ended && note[1].t_ns == 9000 && note[1].byte == -1);
    assert_true(note[1].fault == 1 && note[1].kind == FAULT_CABLE && note[1].link == 3 && note[1].session == 0);
    assert_true(!faulty_is_pulled(f) && owner.n_said == 0);
    faulty_end_cable(f);
    assert_int_equal(n_notes, 2);
    assert_int_equal(faulty_fault(f, LINK_FAULT_PLUG, 0, 0, 0.0), SH_OK);
    expect_fault(2, LINK_FAULT_PLUG, 0, 0, 0.0); /* no cable was pulled: no reset */
    write_it(f, 3, "c\n\n");                     /* due as the cable came in: no new pull */
    assert_int_equal(faulty_pass(f, 3, owner.now_ns), 1);
    assert_true(inner.n_faults == 3 && !faulty_is_pulled(f));
    owner.now_ns = 9001;
    write_it(f, 4, "d\n\n");
    faulty_pass(f, 4, owner.now_ns);
    assert_true(inner.n_faults == 4 && faulty_is_pulled(f));
    expect_fault(3, LINK_FAULT_CABLE, 4, 1, HOUR_MS);
    close_it(f);
}

/* While the cable is out, an act that is due waits for the inner link, and the poll does not end early for it. */
static void acts_wait_for_the_cable(void **state)
{
    (void)state;
    struct link_event events[4];
    struct fault fault[2] = {fault_of_kind(FAULT_CABLE), fault_of_kind(FAULT_DISCONNECT)};
    fault[0].at = 1;
    fault[0].for_ms = HOUR_MS;
    fault[1].at = 2;
    struct faulty_link *f = open_with(fault, 2);
    write_it(f, 0, "a\n\n");
    faulty_pass(f, 0, owner.now_ns);
    write_it(f, 0, "b\n\n");
    assert_int_equal(faulty_pass(f, 0, owner.now_ns), 0);
    assert_true(inner.n_faults == 1 && faulty_is_pulled(f) && !f->session[0].is_gone && faulty_look(f, 0).waits);
    poll_it(f, 3, MOST_MS, events);
    assert_true(inner.want_write == 3 && inner.timeout_ms == MOST_MS);
    assert_int_equal(faulty_fault(f, LINK_FAULT_PLUG, 0, 0, 0.0), SH_OK);
    assert_int_equal(faulty_pass(f, 0, owner.now_ns), SH_ECLOSED);
    assert_true(inner.n_faults == 3 && f->session[0].is_gone);
    expect_fault(2, LINK_FAULT_DISCONNECT, 0, fault_n(&fault[1]), 0.0);
    close_it(f);
}

/* A link that can't fall silent is unplugged instead. One that can't be unplugged either goes on. */
static void a_cable_is_an_unplugging_where_need_be(void **state)
{
    (void)state;
    struct fault cable = fault_of_kind(FAULT_CABLE);
    cable.at = 1;
    cable.for_ms = HOUR_MS;
    struct faulty_link *f = open_with(&cable, 1);
    f->can = LINK_FAULT_BIT(LINK_FAULT_UNPLUG);
    write_it(f, 1, "a\n\n");
    assert_int_equal(faulty_pass(f, 1, owner.now_ns), SH_ECLOSED);
    expect_fault(0, LINK_FAULT_UNPLUG, 1, 0, HOUR_MS);
    assert_true(f->session[0].is_gone && f->session[1].is_gone);
    close_it(f);
    f = open_with(&cable, 1);
    f->can = LINK_FAULT_BIT(LINK_FAULT_DISCONNECT);
    write_it(f, 1, "a\n\n");
    assert_int_equal(faulty_pass(f, 1, owner.now_ns), 1);
    assert_true(inner.n_faults == 0 && inner.n_out == 3 && n_notes == 0);
    close_it(f);
}

static int connect_to(struct faulty_link *f, int session)
{
    struct link_event events[4];
    inner.event[0] = (struct link_event){.kind = LINK_READABLE, .session = 0};
    inner.event[1] = (struct link_event){.kind = LINK_OPENED, .session = session};
    inner.event[2] = (struct link_event){.kind = LINK_READABLE, .session = 0};
    inner.n_events = 3;
    const int n = poll_it(f, 0, -1, events);
    assert_true(events[0].kind == LINK_READABLE && events[n - 1].kind == LINK_READABLE);
    return n == 3;
}

/* Connections count from 1, refused ones too, but not those to a head without power. */
static void clients_are_turned_away(void **state)
{
    (void)state;
    struct fault refuse[2] = {fault_of_kind(FAULT_REFUSE), fault_of_kind(FAULT_REFUSE)};
    refuse[0].from = 2;
    refuse[0].count = 2;
    refuse[0].link = 3;
    refuse[1].link = 2; /* another one */
    struct faulty_link *f = open_with(refuse, 2);
    owner.is_off = 1;
    assert_int_equal(connect_to(f, 0), 1);
    owner.is_off = 0;
    assert_int_equal(connect_to(f, 0), 1);
    assert_int_equal(connect_to(f, 1), 0);
    assert_int_equal(connect_to(f, 2), 0);
    assert_int_equal(connect_to(f, 3), 1);
    assert_int_equal(n_notes, 2);
    for (uint32_t i = 0; i < 2; i++) {
        expect_fault((int)i, LINK_FAULT_REFUSE, 1 + (int)i, fault_n(&refuse[0]), 0.0);
        assert_true(note[i].fault == 1 && note[i].kind == FAULT_REFUSE && note[i].t_ns == 5000 && note[i].link == 3);
        assert_true(note[i].session == 12 + i && note[i].number == 2 + i && note[i].byte == -1 && note[i].n == 0);
    }
    /* After a disconnection with for_ms nobody is let in, and this is the same fault. */
    f->refuse_until_ns = INT64_MAX;
    assert_int_equal(connect_to(f, 4), 0);
    expect_fault(2, LINK_FAULT_REFUSE, 4, 0, 0.0);
    assert_int_equal(n_notes, 2);
    assert_int_equal(faulty_fault(f, LINK_FAULT_DISCONNECT, 5, 6, 7.0), SH_OK); /* ends earlier effects */
    expect_fault(3, LINK_FAULT_DISCONNECT, 5, 6, 7.0);
    assert_int_equal(connect_to(f, 4), 1);
    close_it(f);
}

/* Each time that a host gets a USB device, the effects of the time before are over. */
static void a_plugged_device_begins_anew(void **state)
{
    (void)state;
    struct link_event events[4];
    struct fault longer = fault_of_kind(FAULT_DESCRIPTOR_LENGTH);
    longer.n = 9;
    longer.at = 2;
    struct faulty_link *f = open_with(&longer, 1);
    for (int round = 0; round < 2; round++) {
        inner.event[0] = (struct link_event){.kind = LINK_PLUGGED};
        inner.n_events = 1;
        assert_int_equal(poll_it(f, 0, -1, events), 1);
        expect_fault(2 * round, LINK_FAULT_SLOW_ENUMERATION, 0, 0, 0.0);
        expect_fault(2 * round + 1, LINK_FAULT_DESCRIPTOR_LENGTH, 0, 0, 0.0);
        assert_int_equal(inner.n_faults, 2 + 3 * round);
    }
    expect_fault(4, LINK_FAULT_DESCRIPTOR_LENGTH, -1, 9, 0.0);
    assert_true(n_notes == 1 && note[0].session == 0 && note[0].number == 2 && note[0].n == 9);
    close_it(f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(without_faults_calls_pass_through),
        cmocka_unit_test(a_stall_ends_the_wait),
        cmocka_unit_test(an_unplugged_link_comes_back),
        cmocka_unit_test(an_act_that_fails_is_told),
        cmocka_unit_test(a_cable_is_pulled_once),
        cmocka_unit_test(acts_wait_for_the_cable),
        cmocka_unit_test(a_cable_is_an_unplugging_where_need_be),
        cmocka_unit_test(clients_are_turned_away),
        cmocka_unit_test(a_plugged_device_begins_anew),
    };
    return cmocka_run_group_tests_name("faulty link", tests, NULL, NULL);
}
