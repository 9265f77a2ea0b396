/* SPDX-License-Identifier: MIT */
/* Links of a configuration: what follows for a link from its kind, its protocol and the head, where its keys don't say
 * it; and what each protocol can be spoken on. */
#include <limits.h>

#include "drivers/protocol/protocol.h"
#include "drivers/usb/personalities.h"
#include "firmware_sim/config/check_links.h"
#include "firmware_sim/config/keys.h"
#include "firmware_sim/config/table/reader.h"
#include "tests/unit/config_rig.h"

static void load_link(const char *head, const char *links)
{
    char profile[64], set[256];
    snprintf(profile, sizeof profile, "head={profile: %s, serial: K-7}", head);
    snprintf(set, sizeof set, "links=[%s]", links);
    write_file(config_path, base, strlen(base));
    assert_loads(load_sets((const char *const[]){profile, set}, 2));
}

/* Ports of a VLP-16: data from 2368, positions from 8308 (its manual). */
static void packets_come_from_the_devices_port(void **state)
{
    (void)state;
    static const struct {
        const char *link;
        int source_port, usual_port;
    } rows[] = {
        {"{type: udp, port: 1, protocol: velodyne}", 2368, 1},
        {"{type: udp, port: 1, protocol: velodyne-position}", 8308, 1},
        {"{type: udp, port: 1, protocol: velodyne, source_port: 5}", 5, 0},
        {"{type: tcp, protocol: velodyne-http}", 0, 0},
        {"{type: file, path: x, protocol: velodyne}", 0, 0},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        load_link("velodyne-vlp16", rows[i].link);
        assert_int_equal(cfg->link[0].source_port, rows[i].source_port);
        assert_int_equal(cfg->link[0].usual_port, rows[i].usual_port);
    }
}

/* A Hokuyo turns a second client away. */
static void a_link_has_as_many_clients_as_its_device(void **state)
{
    (void)state;
    load_link("hokuyo-urg-04lx",
              "{type: tcp, protocol: scip}, {type: tcp, protocol: scip, max_sessions: 3}, {type: tcp}");
    assert_int_equal(cfg->link[0].max_sessions, 1);
    assert_int_equal(cfg->link[1].max_sessions, 3);
    assert_int_equal(cfg->link[2].max_sessions, 4);
}

static void a_usb_link_is_the_device_of_its_protocol(void **state)
{
    (void)state;
    static const struct {
        const char *head, *link;
        enum usb_personality_id id;
    } rows[] = {
        {"any-rate", "{type: usb}", USB_PERSONALITY_NATIVE},
        {"hokuyo-urg-04lx", "{type: usb, protocol: scip}", USB_PERSONALITY_HOKUYO},
        {"sick-tim781", "{type: usb, protocol: cola}", USB_PERSONALITY_SICK},
    };
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct usb_personality *p = usb_personality_get(rows[i].id);
        load_link(rows[i].head, rows[i].link);
        const struct link_spec *link = &cfg->link[0];
        assert_int_equal(link->personality, rows[i].id);
        assert_true(link->vid == p->vid && link->pid == p->pid && link->port == 3240); /* that of USB/IP */
        assert_string_equal(link->serial, "K-7");
        assert_int_equal(link->own_serial, 0);
    }
    load_link("any-rate", "{type: usb, vid: 0x1234, pid: 0x5678, serial: abc, port: 9}");
    assert_true(cfg->link[0].vid == 0x1234 && cfg->link[0].pid == 0x5678 && cfg->link[0].port == 9);
    assert_string_equal(cfg->link[0].serial, "abc");
}

/* Without a serial of its own a head has one that is made of its file and the link's place. */
static void a_serial_is_told_from_others(void **state)
{
    (void)state;
    char path[PATH_MAX], want[PATH_MAX + 16];
    assert_loads(load_set("links=[{type: null}, {type: usb}]"));
    assert_non_null(realpath(config_path, path));
    snprintf(want, sizeof want, "1 %s", path);
    assert_int_equal(cfg->link[1].own_serial, 1);
    assert_string_equal(cfg->link[1].serial, cfg->head.serial);
    assert_string_equal(cfg->link[1].whose, want);
}

/* Long paths differ mostly at their ends: the last 287 bytes are used. */
static void a_long_path_is_cut_at_its_beginning(void **state)
{
    (void)state;
    static struct cfg_reader rd;
    cfg_reader_init(&rd, "long.yaml", &cfg_config_table, cfg, &diagnostics);
    for (size_t len = 286; len <= 290; len++) {
        struct link_spec link = {.protocol = PROTOCOL_NATIVE};
        char want[400];
        for (size_t i = 0; i < len; i++)
            cfg->file[i] = (char)('a' + i % 26);
        cfg->file[len] = '\0';
        cfg_set_usb_identity(&rd, cfg, &link, 7);
        snprintf(want, sizeof want, "7 %s", cfg->file + (len > 287 ? len - 287 : 0));
        assert_string_equal(link.whose, want);
    }
}

/* Typed from drivers/protocol/README.md and the manuals: n null, f file, p pty, t tcp, u usb, d udp, w web. */
static void protocols_are_spoken_on_their_links(void **state)
{
    (void)state;
    static const struct {
        const char *protocol, *head, *kinds, *allowed;
    } rows[] = {
        {"native", "any-rate", "nfptuw", "null, file, pty, tcp, usb, web"},
        {"nmea", "any-rate", "nfptd", "null, file, pty, tcp, udp"},
        {"scip", "hokuyo-urg-04lx", "ptu", "pty, tcp, usb"},
        {"cola", "sick-tim781", "ptu", "pty, tcp, usb"},
        {"velodyne", "velodyne-vlp16", "nfd", "null, file, udp"},
        {"velodyne-position", "velodyne-vlp16", "nfd", "null, file, udp"},
        {"velodyne-http", "velodyne-vlp16", "t", "tcp"},
    };
    static const char *const links[] = {"type: null",         "type: file, path: x", "type: pty", "type: tcp",
                                        "type: udp, port: 1", "type: usb",           "type: web"};
    static const char letters[] = "nfptduw", *const names[] = {"null", "file", "pty", "tcp", "udp", "usb", "web"};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        for (int k = 0; k < 7; k++) {
            char profile[64], set[128], text[200];
            snprintf(profile, sizeof profile, "head={profile: %s}", rows[i].head);
            snprintf(set, sizeof set, "links=[{%s, protocol: %s}]", links[k], rows[i].protocol);
            write_file(config_path, base, strlen(base));
            load_sets((const char *const[]){profile, set, "time.epoch=utc",
                                            "stations[0]={position_m: [1, 2, 3], lat_deg: 1, lon_deg: 2, height_m: 3}"},
                      4);
            if (strchr(rows[i].kinds, letters[k]) != NULL) {
                assert_loads(err.code);
                continue;
            }
            snprintf(text, sizeof text, "protocol %s is not available on a %s link; allowed %s", rows[i].protocol,
                     names[k], rows[i].allowed);
            expect_only("--set ", "links[0].protocol", text);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(packets_come_from_the_devices_port),
        cmocka_unit_test(a_link_has_as_many_clients_as_its_device),
        cmocka_unit_test(a_usb_link_is_the_device_of_its_protocol),
        cmocka_unit_test(a_serial_is_told_from_others),
        cmocka_unit_test(a_long_path_is_cut_at_its_beginning),
        cmocka_unit_test(protocols_are_spoken_on_their_links),
    };
    return cmocka_run_group_tests_name("links of a configuration", tests, set_up, tear_down);
}
