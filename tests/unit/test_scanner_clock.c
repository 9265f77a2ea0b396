/* SPDX-License-Identifier: MIT */
/* The clock of a SICK scanner: what it shows at power-up, its errors, power cycles, and what a journal has of it. */
#include "firmware_sim/device/scanner_clock.h"

#include "tests/unit/device_rig.h"

#define MS INT64_C(1000000)
#define S  INT64_C(1000000000)

static const int64_t EPOCH_NS = INT64_C(1767225600) * S; /* date -u -d 2026-01-01 +%s */

static void expect(struct rig *rig, const char *line, const char *reply)
{
    assert_string_equal(rig_tell(rig, line, rig->next), reply);
}

/* 1970 where the head knows no time, or a server is to be asked; else UTC. The gains are exact: parts per million of a
 * second are us. */
static void it_begins_with_power(void **state)
{
    (void)state;
    static const struct {
        const char *sets[3];
        int64_t at_0_ns, after_2_s_ns;
    } cases[] = {
        {{"time.epoch=none", "ntp.role=none", "time.drift_ppm=0"}, 0, 2 * S},
        {{"time.epoch=none", "ntp.role=none", "time.drift_ppm=25"}, 0, 2 * S + 50000},
        {{"time.epoch=none", "time.jump_s=5", "time.jump_at_s=1"}, 0, 7 * S},
        {{"time.epoch=none", "time.offset_s=5", "ntp.role=none"}, 0, 2 * S}, /* an offset shows in a known time alone */
        {{"time.epoch=2026-01-01T00:00:00Z", "time.offset_s=5", "ntp.role=none"}, EPOCH_NS + 5 * S, EPOCH_NS + 7 * S},
        {{"time.epoch=2026-01-01T00:00:00Z", "time.drift_ppm=-25", "ntp.role=server"},
         EPOCH_NS,
         EPOCH_NS + 2 * S - 50000},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        struct rig *rig = rig_open(NULL, cases[i].sets, 3);
        if (device_date_ns(rig->device, 0) != cases[i].at_0_ns) fail_msg("case %zu at 0", i);
        if (device_date_ns(rig->device, 2 * S) != cases[i].after_2_s_ns) fail_msg("case %zu after 2 s", i);
        rig_close(rig);
    }
}

/* Shifts the date, as an answer to a request with the present settings does. */
static void shift(struct rig *rig, int64_t by_ns)
{
    struct device_time_server server;
    device_get_time_server(rig->device, &server);
    assert_int_equal(device_shift_date(rig->device, &server, by_ns), 1);
}

static void a_power_cycle_begins_anew(void **state)
{
    (void)state;
    static const char *const sets[] = {"ntp.update_s=9", "ntp.role=none"};
    struct rig *rig = rig_open(NULL, sets, 2);
    struct device_time_server server;
    rig_go_to(rig, 300);
    expect(rig, "TIME:SHIF 40 S", "OK");
    expect(rig, "TIME:SERV NONE,127.0.0.1,5,1,ETH", "OK");
    assert_true(device_date_ns(rig->device, 300 * MS) == 40 * S + 300 * MS);
    shift(rig, -S);
    device_get_time_server(rig->device, &server);
    expect(rig, "TIME:SERV NONE,127.0.0.1,5,2,ETH", "OK"); /* an answer from before sets nothing */
    assert_int_equal(device_shift_date(rig->device, &server, -S), 0);
    expect(rig, "TIME:SERV NONE,127.0.0.1,5,1,ETH", "OK");
    expect(rig, "TIME:SHIF?", "39000000000");
    expect(rig, "HEAD:REB", "OK");
    rig_go_to(rig, 310); /* power came with tick 301 */
    assert_true(device_date_ns(rig->device, 310 * MS) == 9 * MS);
    assert_true(device_date_ns(rig->device, 300 * MS) == 39 * S + 300 * MS); /* scans from before are still sent */
    expect(rig, "TIME:SHIF?", "0");
    expect(rig, "TIME:SERV?", "NONE,127.0.0.1,9,0,ETH");
    device_get_time_server(rig->device, &server);
    assert_int_equal(server.power_ons, 2);
    server.power_ons = 1; /* nor does an answer from before the power cycle */
    assert_int_equal(device_shift_date(rig->device, &server, -S), 0);
    expect(rig, "TIME:SHIF?", "0");
    rig_close(rig);
}

/* Scans from before a power cycle are still sent after it. Their dates are those of the clock that they were made with:
 * that of the period before, whichever it is, and with UTC where the clock had it. */
static void dates_from_before_a_power_cycle(void **state)
{
    (void)state;
    static const struct {
        const char *sets[2];
        int64_t zero_ns;
    } cases[] = {{{"time.epoch=none", "ntp.role=none"}, 0},
                 {{"time.epoch=2026-01-01T00:00:00Z", "ntp.role=none"}, EPOCH_NS}};
    for (size_t i = 0; i < 2; i++) {
        const int by_utc = cases[i].zero_ns != 0;
        struct rig *rig = rig_open(NULL, cases[i].sets, 2);
        for (int64_t cycle = 0, on_ms = 0; cycle < 3; cycle++) {
            rig_go_to(rig, (uint64_t)on_ms + 300);
            const int64_t t_ns = (on_ms + 300) * MS, date_ns = by_utc ? EPOCH_NS + t_ns : 300 * MS;
            assert_true(device_date_ns(rig->device, t_ns) == date_ns);
            expect(rig, "HEAD:REB", "OK");
            on_ms = (int64_t)rig->next + 1; /* power comes with the next tick */
            rig_go_to(rig, (uint64_t)on_ms + 10);
            assert_true(device_date_ns(rig->device, (on_ms + 5) * MS) == (by_utc ? EPOCH_NS + on_ms * MS : 0) + 5 * MS);
            assert_true(device_date_ns(rig->device, t_ns) == date_ns);
        }
        rig_close(rig);
    }
}

/* Whether a server is to be asked: by role, interface, state of the head, and address. */
static void who_is_asked(void **state)
{
    (void)state;
    static const struct {
        const char *line, *anywhere;
        int asks, refused;
    } cases[] = {
        {"TIME:SERV CLIENT,127.0.0.1,5,0,ETH", "off", 1, 0}, {"TIME:SERV CLIENT,127.9.9.9,5,0,ETH", "off", 1, 0},
        {"TIME:SERV NONE,127.0.0.1,5,0,ETH", "off", 0, 0},   {"TIME:SERV SERVER,127.0.0.1,5,0,ETH", "off", 0, 0},
        {"TIME:SERV CLIENT,127.0.0.1,5,0,CAN", "off", 0, 0}, {"TIME:SERV CLIENT,192.0.2.7,5,0,ETH", "off", 1, 0},
        {"TIME:SERV CLIENT,192.0.2.8,5,0,ETH", "off", 0, 1}, {"TIME:SERV CLIENT,192.0.2.8,5,0,ETH", "on", 1, 0},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char anywhere[32];
        struct device_time_server server;
        snprintf(anywhere, sizeof anywhere, "ntp.anywhere=%s", cases[i].anywhere);
        const char *const sets[] = {"ntp.address=192.0.2.7", "ntp.port=4123", anywhere};
        struct rig *rig = rig_open(NULL, sets, 3);
        device_watch_time_server(rig->device, 1 << 20); /* no such descriptor: nobody is woken */
        expect(rig, cases[i].line, "OK");
        device_get_time_server(rig->device, &server);
        assert_false(server.asks || server.refused); /* it boots */
        rig_go_to(rig, 300);
        device_get_time_server(rig->device, &server);
        if (server.asks != cases[i].asks || server.refused != cases[i].refused) fail_msg("case %zu", i);
        assert_int_equal(server.port, 4123);
        rig_close(rig);
    }
}

/* *RST, HEAD:STORe and a new start. */
static void the_server_is_stored(void **state)
{
    (void)state;
    static char path[96]; /* outlives a test that fails */
    struct sh_err err;
    struct settings_file *file;
    struct device_options options = {0};
    snprintf(path, sizeof path, "%s/time-settings", folder);
    for (int start = 0; start < 2; start++) {
        need(settings_file_open(path, "test", NULL, &file, &err), &err);
        options.settings = file;
        struct rig *rig = rig_open(&options, NULL, 0);
        rig_go_to(rig, 300);
        expect(rig, "TIME:SERV?", start == 0 ? "NONE,127.0.0.1,600,0,ETH" : "SERVER,127.0.0.3,7,-1,CAN");
        if (start == 0) expect(rig, "TIME:SERV SERVER,127.0.0.3,7,-1,CAN", "OK");
        if (start == 0) expect(rig, "HEAD:STOR", "OK");
        expect(rig, "TIME:SERV NONE,127.0.0.1,8,0,ETH", "OK");
        expect(rig, "*RST", "OK");
        expect(rig, "TIME:SERV?", "SERVER,127.0.0.3,7,-1,CAN");
        rig_close(rig);
        assert_int_equal(settings_file_close(file, &err), SH_OK);
    }
    unlink(path);
}

/* The dates of a session, as a replay of its journal gives them again. An answer's shift is a command of the device. */
static void a_journal_has_the_dates(void **state)
{
    (void)state;
    int64_t dates_ns[2][4];
    for (int again = 0; again < 2; again++) {
        const struct device_options options = {.journal = again ? NULL : journal_path,
                                               .replay = again ? journal_path : NULL};
        struct rig *rig = rig_open(&options, NULL, 0);
        rig_go_to(rig, 400);
        if (!again) shift(rig, EPOCH_NS + 123456789);
        rig_go_to(rig, 500);
        if (!again) shift(rig, -987654321);
        rig_go_to(rig, 600);
        for (int i = 0; i < 4; i++)
            dates_ns[again][i] = device_date_ns(rig->device, 550 * MS + i);
        rig_close(rig);
    }
    assert_true(dates_ns[0][3] == EPOCH_NS + 123456789 - 987654321 + 550 * MS + 3);
    assert_memory_equal(dates_ns[0], dates_ns[1], sizeof dates_ns[0]);
}

/* A scanner that is to ask a time server begins with 1970, whatever time.epoch says. Only a scanner with dates can ask
 * one. The test's run.yaml stays. */
static void a_client_begins_with_1970(void **state)
{
    (void)state;
    static const char *const sets[] = {"ntp.role=client", "time.drift_ppm=-25", "ntp.max_offset_s=1.25"};
    char path[96];
    snprintf(path, sizeof path, "%s/run.yaml", folder);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f, "head: {profile: sick-lms111, lines_hz: 50, prr_hz: 36000, frames: 0}\n"
               "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
               "stations: [{position_m: [0, 0, 0]}]\n"
               "links: [{type: tcp, port: 0, protocol: cola}]\n"
               "time: {epoch: 2026-01-01T00:00:00Z}\n");
    assert_int_equal(fclose(f), 0);
    struct rig *rig = rig_open(NULL, sets, 3);
    assert_string_equal(rig_tell(rig, "TIME:SERV? STATE", 0), "OFF,1250000000,0,0,0,0,0");
    assert_true(device_date_ns(rig->device, 0) == 0);
    assert_true(device_date_ns(rig->device, 2 * S) == 2 * S - 50000);
    rig_close(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_begins_with_power),
        cmocka_unit_test(a_power_cycle_begins_anew),
        cmocka_unit_test(dates_from_before_a_power_cycle),
        cmocka_unit_test(who_is_asked),
        cmocka_unit_test(the_server_is_stored),
        cmocka_unit_test(a_journal_has_the_dates),
        cmocka_unit_test(a_client_begins_with_1970), /* the last one */
    };
    return cmocka_run_group_tests_name("scanner clock", tests, make_folder, remove_folder);
}
