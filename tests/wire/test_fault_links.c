/* SPDX-License-Identifier: MIT */
/* Links that are cut, refused and unplugged on request, by the program. The truth says where. The client sees it there,
 * comes back and goes on, and its neighbour's stream is the clean one. */
#include "core/bytes.h"
#include "tests/wire/room.h"
#include "tests/wire/usbip_host.h"

/* A scan of half a second has 500 ticks, each with a frame of points. */
static const struct room_config SCAN = {
    .prr_hz = 20000, .lines_hz = 100, .pan_deg_s = 180, .pan_stop_deg = 90, .frames = 1};

/* Starts a head with a link to be hit and a clean one after it. more: as in head_start. */
static struct head start(struct wire *wire, const char *link, const char *fault, const char *const *more)
{
    char links[300], faults[300], told[352], path[352];
    const char *args[WIRE_MAX_ARGS] = {"--quiet", "--truth", told};
    struct room_config config = SCAN;
    int n = 3;
    room_write(wire);
    snprintf(links, sizeof links, "links: [{%s}, {type: tcp, port: 0}]\n", link);
    snprintf(faults, sizeof faults, "faults: [{link: 1, %s}]\nloop: {queue_ms: 10000}\n", fault); /* for late readers */
    config.links = links;
    config.more = faults;
    snprintf(path, sizeof path, "%s", room_config_write(wire, &config));
    snprintf(told, sizeof told, "%s", wire_path(wire, "truth.json"));
    while (more != NULL && *more != NULL)
        args[n++] = *more++;
    args[n] = NULL;
    return head_start(wire, path, args);
}

/* Returns the number after the key in line i of the truth, from 0. The line's kind must be this. */
static int64_t truth(const struct wire *wire, int i, const char *kind, const char *key)
{
    char *text = wire_read(wire_path(wire, "truth.json"), NULL), *line = text, want[64];
    for (; i > 0 && line != NULL; i--)
        line = strchr(line, '\n') != NULL ? strchr(line, '\n') + 1 : NULL;
    char *end = line != NULL ? strchr(line, '\n') : NULL;
    if (end == NULL) fail_msg("no such line in %s", text);
    *end = '\0';
    snprintf(want, sizeof want, "\"kind\":\"%s\"", kind);
    if (strstr(line, want) == NULL) fail_msg("%s is not of kind %s", line, kind);
    snprintf(want, sizeof want, "\"%s\":", key);
    const char *at = strstr(line, want);
    if (at == NULL) fail_msg("no %s in %s", key, line);
    const int64_t value = strtoll(at + strlen(want), NULL, 10);
    free(text);
    return value;
}

static int truth_lines(const struct wire *wire)
{
    char *text = wire_read(wire_path(wire, "truth.json"), NULL);
    int n = 0;
    for (const char *at = text; (at = strchr(at, '\n')) != NULL; at++)
        n++;
    free(text);
    return n;
}

/* Takes frames of the scan without a gap until the connection ends. Returns the number of the last, and its t_ns.
 * most_gaps is 1 for a terminal: when it is hung up, the kernel throws away what waits to be read, and frames on their
 * way come after. */
static uint32_t read_to_cut(struct scanhead *sh, int most_gaps, int64_t *t_ns)
{
    struct scanhead_frame frame;
    uint32_t last = 0;
    for (int n = 0, gaps = 0;; n++) {
        const int rc = scanhead_next(sh, &frame, DEADLINE_MS);
        if (rc == SCANHEAD_ECLOSED && n > 0) return last;
        assert_int_equal(rc, SCANHEAD_OK);
        if ((frame.flags & SCANHEAD_LOCAL) != 0) continue;
        assert_true(n == 0 || frame.seq > last);
        gaps += n > 0 && frame.seq != last + 1;
        assert_true(gaps <= most_gaps);
        last = frame.seq;
        *t_ns = frame.t_ns;
    }
}

/* Reads until the scan is over. A client that comes back late may miss its end, and learns of it by telemetry. */
static void read_to_end(struct scanhead *sh, struct scanhead_frame *frame)
{
    enum { IDLE = 2 };
    while (!is_event(frame, SCANHEAD_EV_SCAN_END) &&
           !(frame->type == SCANHEAD_TELEMETRY && le_get32(frame->payload) == IDLE))
        client_next(sh, frame);
}

/* The clean link's reader gets the whole scan and its hash, which is the head's. */
static void read_clean(struct scanhead *sh, char hash[65])
{
    struct scanhead_frame frame;
    struct scanhead_stats stats;
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    scanhead_get_stats(sh, &stats);
    assert_int_equal(stats.seq_lost + stats.reader_lost + stats.bad_payload + stats.bad_bytes, 0);
    scanhead_hash_hex(sh, hash);
}

/* Both sessions are there, and the scan begins. */
static void begin(struct scanhead *hit, struct scanhead *clean)
{
    client_ask(hit, "*IDN?");
    scanhead_hash_start(clean);
    client_wait_state(clean, "idle");
    client_tell(clean, "SCAN:START");
}

/* A client is cut off at the frame that the truth names, and gets nothing from there on. The client comes back, and its
 * stream goes on later. The count of one holds for the link, so the second session is not cut. */
static void cut_and_return(struct wire *wire, const char *link, const char *fault, const char *kind)
{
    struct head head = start(wire, link, fault, NULL);
    struct scanhead_frame frame;
    struct scanhead *hit = client_open(head_link(&head, 0)), *clean = client_open(head_link(&head, 1));
    char seen[65], said[65];
    int64_t t_ns = 0;
    begin(hit, clean);
    const uint32_t last = read_to_cut(hit, strstr(link, "pty") != NULL, &t_ns);
    assert_int_equal(scanhead_reattach(hit, DEADLINE_MS), SCANHEAD_OK);
    client_next(hit, &frame);
    while ((frame.flags & SCANHEAD_LOCAL) != 0)
        client_next(hit, &frame);
    const uint32_t next = frame.seq;
    assert_true(frame.t_ns > t_ns); /* how much later, the load of the machine decides */
    read_to_end(hit, &frame);
    read_clean(clean, seen);
    scanhead_close(hit);
    scanhead_close(clean);
    head_end(&head, SIGTERM);
    stats_hash(wire, said);
    assert_string_equal(seen, said);
    assert_int_equal(truth_lines(wire), 1);
    const int64_t seq = truth(wire, 0, kind, "seq");
    assert_int_equal(truth(wire, 0, kind, "frame"), 60);
    assert_true(last < seq); /* nothing from there on; frames that wait for a late reader are gone, too */
    assert_true(next >= seq);
}

static void test_disconnect(void **state)
{
    cut_and_return(*state, "type: tcp, port: 0", "kind: disconnect, at: 60, count: 1", "disconnect");
}

static void test_disconnect_pty(void **state)
{
    cut_and_return(*state, "type: pty, path: port", "kind: disconnect, at: 60, count: 1", "disconnect");
}

static void test_unplug(void **state)
{
    cut_and_return(*state, "type: tcp, port: 0", "kind: unplug, at: 60, count: 1, for_ms: 100", "unplug");
}

static void test_unplug_pty(void **state)
{
    cut_and_return(*state, "type: pty, path: port", "kind: unplug, at: 60, count: 1, for_ms: 100", "unplug");
}

/* Without a count each session is cut at its own frame 60: frames count from 1 in each. */
static void test_each_session(void **state)
{
    struct wire *wire = *state;
    struct head head = start(wire, "type: tcp, port: 0", "kind: disconnect, at: 60", NULL);
    struct scanhead *hit = client_open(head_link(&head, 0)), *clean = client_open(head_link(&head, 1));
    int64_t t_ns = 0;
    uint32_t last[3];
    begin(hit, clean);
    for (int round = 0; round < 3; round++) {
        last[round] = read_to_cut(hit, 0, &t_ns);
        if (round < 2) assert_int_equal(scanhead_reattach(hit, DEADLINE_MS), SCANHEAD_OK);
    }
    scanhead_close(hit);
    scanhead_close(clean);
    head_end(&head, SIGTERM);
    assert_int_equal(truth_lines(wire), 3);
    int whole = 0; /* rounds in which the reader was not late, and so has all before */
    for (int round = 0; round < 3; round++) {
        const int64_t gone = truth(wire, round, "disconnect", "seq") - last[round];
        assert_true(gone >= 1);
        whole += gone == 1;
        assert_int_equal(truth(wire, round, "disconnect", "frame"), 60);
    }
    assert_true(whole > 0);
}

/* Two clients of the link come to the frame of an unplugging. The unplugging is carried out and reported once. */
static void test_two_clients(void **state)
{
    struct wire *wire = *state;
    struct head head = start(wire, "type: tcp, port: 0", "kind: unplug, at: 60, until_s: 1, for_ms: 100", NULL);
    struct scanhead *hit = client_open(head_link(&head, 0)), *too = client_open(head_link(&head, 0)),
                    *clean = client_open(head_link(&head, 1));
    int64_t t_ns = 0;
    client_ask(too, "*IDN?");
    begin(hit, clean);
    const uint32_t last[2] = {read_to_cut(hit, 0, &t_ns), read_to_cut(too, 0, &t_ns)};
    scanhead_close(hit);
    scanhead_close(too);
    scanhead_close(clean);
    head_end(&head, SIGTERM);
    assert_int_equal(truth_lines(wire), 1);
    const int64_t seq = truth(wire, 0, "unplug", "seq");
    assert_true(last[0] < seq && last[1] < seq);
}

/* As fast as it computes, a head waits for its readers, but not for one that is gone. */
static void test_fast(void **state)
{
    struct wire *wire = *state;
    struct head head = start(wire, "type: tcp, port: 0", "kind: disconnect, at: 60, count: 1, for_ms: 100",
                             (const char *const[]){"--pace", "fast", NULL});
    struct scanhead *hit = client_open(head_link(&head, 0)), *clean = client_open(head_link(&head, 1));
    char seen[65], said[65];
    int64_t t_ns = 0;
    begin(hit, clean);
    read_to_cut(hit, 0, &t_ns);
    read_clean(clean, seen);
    /* The client is turned away until the fault's time is over. The head only says that a client was lost. */
    int rc;
    char reply[100];
    do
        rc = scanhead_reattach(hit, DEADLINE_MS) == SCANHEAD_OK
                 ? scanhead_command(hit, "HEAD:STAT?", reply, sizeof reply, DEADLINE_MS)
                 : SCANHEAD_ECLOSED;
    while (rc != SCANHEAD_OK);
    const char *told =
        client_ask(hit, "SYST:ERR?"); /* said while it scans: on a busy machine the scan is over sooner */
    if (strcmp(told, "0,\"No error\"") != 0 && strstr(told, "Client lost; session 1") == NULL) fail_msg("%s", told);
    assert_string_equal(client_ask(hit, "SYST:ERR?"), "0,\"No error\"");
    scanhead_close(hit);
    scanhead_close(clean);
    head_end(&head, SIGTERM);
    stats_hash(wire, said);
    assert_string_equal(seen, said);
    assert_int_equal(truth_lines(wire), 1);
}

/* In lock-step a client is cut off and comes back while device time stands; then the rest is granted. */
static void test_step(void **state)
{
    struct wire *wire = *state;
    struct head head = start(wire, "type: tcp, port: 0", "kind: unplug, at: 60, count: 1, for_ms: 100",
                             (const char *const[]){"--pace", "step", NULL});
    struct scanhead *hit = client_open(head_link(&head, 0)), *clean = client_open(head_link(&head, 1));
    struct scanhead_frame frame;
    char seen[65], said[65];
    int64_t t_ns = 0;
    client_ask(hit, "*IDN?");
    scanhead_hash_start(clean);
    while (strcmp(client_ask(clean, "HEAD:STAT?"), "idle") != 0)
        client_tell(clean, "TIME:STEP 50 MS");
    client_tell(clean, "SCAN:START");
    client_tell(clean, "TIME:STEP 200 MS");
    read_to_cut(hit, 0, &t_ns);
    assert_int_equal(scanhead_reattach(hit, DEADLINE_MS), SCANHEAD_OK);
    const int64_t now_ns = atoll(client_ask(hit, "TIME?"));
    client_tell(clean, "TIME:STEP 1000 MS");
    do
        client_next(hit, &frame);
    while (frame.t_ns < now_ns);
    client_until(hit, SCANHEAD_EV_SCAN_END, &frame);
    read_clean(clean, seen);
    scanhead_close(hit);
    scanhead_close(clean);
    head_end(&head, SIGTERM);
    stats_hash(wire, said);
    assert_string_equal(seen, said);
    assert_int_equal(truth_lines(wire), 1);
}

/* Returns 1 when the head answers on it, 0 when it ends without a byte. */
static int is_answered(int fd)
{
    char byte;
    struct pollfd slot = {.fd = fd, .events = POLLIN};
    if (write(fd, "*IDN?\n", 6) < 0) return 0;
    assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
    const int answered = read(fd, &byte, 1) == 1;
    close(fd);
    return answered;
}

static void test_refuse(void **state)
{
    struct wire *wire = *state;
    struct head head = start(wire, "type: tcp, port: 0", "kind: refuse, from: 2, every: 2", NULL);
    for (int i = 1; i <= 6; i++)
        assert_int_equal(is_answered(raw_connect(head_link(&head, 0))), i % 2);
    struct scanhead *clean = client_open(head_link(&head, 1));
    assert_string_equal(client_ask(clean, "SYST:ERR?"), "0,\"No error\"");
    scanhead_close(clean);
    head_end(&head, SIGTERM);
    assert_int_equal(truth_lines(wire), 3);
    for (int i = 0; i < 3; i++)
        assert_int_equal(truth(wire, i, "refuse", "connection"), 2 * (i + 1));
}

/* The recorder waits for the head, and reports how often it was away. */
static void test_record(void **state)
{
    struct wire *wire = *state;
    struct head head = start(wire, "type: tcp, port: 0", "kind: unplug, at: 100, count: 1, for_ms: 100", NULL);
    char cloud[300], sheet[300], source[128], *text;
    snprintf(cloud, sizeof cloud, "%s", wire_path(wire, "scan.ply"));
    snprintf(sheet, sizeof sheet, "%s", wire_path(wire, "record.json"));
    snprintf(source, sizeof source, "%s", head_link(&head, 0));
    const char *const args[] = {"record", source, "-o", cloud, "--stats", sheet, "--replug", "20", "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "record.err", -1)), 1);
    text = wire_read(sheet, NULL);
    assert_non_null(strstr(text, "\"replugs\": 1,"));
    free(text);
    head_end(&head, SIGTERM);
    assert_int_equal(truth(wire, 0, "unplug", "frame"), 100);
}

/* A fault that a link can't have is refused. */
static void test_wrong_link(void **state)
{
    struct wire *wire = *state;
    static const char *const wrong[] = {"kind: usb_reset, link: 2", "kind: slow_enumeration, for_ms: 5, link: 2",
                                        "kind: disconnect, link: 1", "kind: refuse, link: 1",
                                        "kind: descriptor_length, link: 2"};
    struct room_config config = SCAN;
    config.links = "links: [{type: \"null\"}, {type: tcp, port: 0}]\n";
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        char faults[200], want[100], *text;
        snprintf(faults, sizeof faults, "faults: [{%s}]\n", wrong[i]);
        room_write(wire);
        config.more = faults;
        const char *const args[] = {"check", room_config_write(wire, &config), NULL};
        assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 2);
        text = wire_read(wire_path(wire, "err"), NULL);
        snprintf(want, sizeof want, "link %c can't have", wrong[i][strlen(wrong[i]) - 1]);
        if (strstr(text, want) == NULL) fail_msg("%s: %s", wrong[i], text);
        free(text);
    }
}

/* ---- USB */

/* Each connection is an enumeration. A fault of an enumeration strikes only the connection of its number. An unplugged
 * device is gone for a while, and comes back as the same. */
static void test_usb(void **state)
{
    struct wire *wire = *state;
    struct head head = start(wire, "type: usb, port: 0",
                             "kind: descriptor_length, at: 1, n: 4}, {kind: slow_enumeration, at: 2, for_ms: 20}, "
                             "{kind: unplug, at: 1, count: 1, for_ms: 100",
                             (const char *const[]){"--start", "--set", "head.frames=1000", NULL});
    uint8_t data[16384];
    int n;
    struct usbip_host host = usbip_host_open(&head);
    n = usbip_host_control(&host, 0x80, 6, 0x0200, 0, data, 512);
    assert_int_equal(le_get16(data + 2), n + 4);
    usbip_host_close(&host);
    host = usbip_host_open(&head);
    const int64_t from_ms = wire_now_ms();
    n = usbip_host_control(&host, 0x80, 6, 0x0200, 0, data, 512);
    assert_int_equal(le_get16(data + 2), n);
    assert_int_equal(usbip_host_control(&host, 0x00, 9, 1, 0, NULL, 0), 0);
    assert_int_equal(usbip_host_control(&host, 0x41, 0x22, 1, 2, NULL, 0), 0);
    assert_true(wire_now_ms() - from_ms >= 3 * 20 - 1); /* three requests, and a clock that is rounded down */
    for (int i = 0; i < 100; i++)
        usbip_host_ask(&host, 3, sizeof data);
    for (ssize_t got = 1; got > 0;) {
        struct pollfd slot = {.fd = host.fd, .events = POLLIN};
        assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
        got = read(host.fd, data, sizeof data);
    }
    usbip_host_close(&host);
    host = usbip_host_open_within(&head, DEADLINE_MS);
    n = usbip_host_control(&host, 0x80, 6, 0x0200, 0, data, 512);
    assert_int_equal(le_get16(data + 2), n);
    usbip_host_close(&host);
    head_end(&head, SIGTERM);
    assert_int_equal(truth_lines(wire), 3);
    assert_int_equal(truth(wire, 0, "descriptor_length", "connection"), 1);
    assert_int_equal(truth(wire, 0, "descriptor_length", "n"), 4);
    assert_int_equal(truth(wire, 1, "slow_enumeration", "connection"), 2);
    assert_int_equal(truth(wire, 2, "unplug", "frame"), 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_disconnect, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_disconnect_pty, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_unplug, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_unplug_pty, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_each_session, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_two_clients, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_fast, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_step, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_refuse, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_record, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_wrong_link, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_usb, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
