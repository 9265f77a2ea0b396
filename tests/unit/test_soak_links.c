/* SPDX-License-Identifier: MIT */
/* These tests check which links of a soak get a client, and why others do not. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "firmware_sim/app/studio/soak/client.h"
#include "firmware_sim/fault/fault.h"
#include "tests/unit/soak_client_rig.h"

static void close_all(void)
{
    trace[0] = '\0';
    soak_clients_close(&soak);
}

static void some_links_get_a_client(void **unused)
{
    static const struct {
        const char *type, *endpoint, *protocol, *why;
    } rows[] = {
        {"tcp", "tcp:127.0.0.1:7", "native", NULL},
        {"pty", "tty:/tmp/head", NULL, NULL},
        {"tcp", "tcp:127.0.0.1:8", "scip", "libscanhead supports only the native protocol"},
        {"pty", "tty:/dev/pts/3", "native",
         "a terminal that disappears and appears again needs a fixed path, links[].path"},
        {"udp", "udp:127.0.0.1:9", "velodyne", "its packets go to another place, or their port is taken"},
        {"web", "http://127.0.0.1:8", "native", "libscanhead does not support WebSocket"},
        {"null", "null", NULL, "nothing answers there"},
        {"file", "file:x", "native", "nothing answers there"},
    };
    struct sh_err err;
    (void)unused;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        add_place(rows[i].type, rows[i].endpoint, rows[i].protocol);
    assert_int_equal(open_all(0, &err), SH_OK);
    for (uint32_t i = 0; i < soak.n_links; i++) {
        const struct soak_link *link = &soak.link[i];
        assert_ptr_equal(link->soak, &soak);
        assert_int_equal(link->number, i + 1);
        assert_string_equal(link->type, rows[i].type);
        assert_string_equal(link->endpoint, rows[i].endpoint);
        assert_string_equal(link->source, rows[i].endpoint);
        assert_int_equal(link->usable, rows[i].why == NULL);
        assert_int_equal(link->fact != NULL, rows[i].why == NULL);
        if (rows[i].why == NULL) assert_null(link->not_soaked);
        if (rows[i].why != NULL) assert_string_equal(link->not_soaked, rows[i].why);
    }
    close_all();
}

static void a_usb_link_needs_a_device_here(void **unused)
{
    struct sh_err err;
    (void)unused;
    add_place("usb", "usbip:127.0.0.1:3240", "native");
    add_place("usb", "usbip:127.0.0.1:3241", "native");
    cfg.link[0].attach = 1;
    strcpy(cfg.link[0].serial, "A1");
    strcpy(cfg.link[1].serial, "A2");
    assert_int_equal(open_all(0, &err), SH_OK);
    assert_true(soak.link[0].usable && !soak.link[1].usable);
    assert_string_equal(soak.link[0].source, "usb:A1");
    assert_string_equal(soak.link[0].endpoint, "usbip:127.0.0.1:3240");
    assert_string_equal(soak.link[1].not_soaked, "only a USB head with backend usbip, attach on and protocol native is "
                                                 "attached to this machine");
    close_all();
}

static void one_link_alone_is_asked_for(void **unused)
{
    struct sh_err err;
    (void)unused;
    add_place("tcp", "tcp:a", "native");
    add_place("tcp", "tcp:b", "native");
    add_place("null", "null", NULL);
    assert_int_equal(open_all(2, &err), SH_OK);
    assert_true(!soak.link[0].usable && soak.link[1].usable && !soak.link[2].usable);
    assert_string_equal(soak.link[0].not_soaked, "not asked for (--link)");
    assert_string_equal(soak.link[2].not_soaked, "not asked for (--link)");
    close_all();
    assert_string_equal(trace, "close:none datagrams:none close:none datagrams:none close:none datagrams:none ");
    assert_int_equal(open_all(3, &err), SH_EINPUT);
    assert_string_equal(err.text, "head.yaml: links: soak can use none of them; allowed are pty, tcp and usb (attach "
                                  "on) with protocol native, as --set links.0.type=tcp");
    make_soak(NULL);
    assert_int_equal(open_all(0, &err), SH_EINPUT); /* there are no links */
}

/* Packets are compared unless a fault lets them begin anew, whatever its place in the list. */
static void packets_are_compared(void **unused)
{
    struct sh_err err;
    (void)unused;
    add_place("udp", "udp:127.0.0.1:9", "velodyne");
    soak.datagrams[0] = (struct soak_datagrams *)&cfg;
    soak.faults.n = 2;
    for (int kind = 0; kind < FAULT_N_KINDS; kind++)
        for (int i = 0; i < 2; i++) {
            const int anew = kind == FAULT_POWER_CYCLE || kind == FAULT_UNPLUG || kind == FAULT_CABLE;
            soak.faults.fault[0].kind = soak.faults.fault[1].kind = FAULT_DROP;
            soak.faults.fault[i].kind = (enum fault_kind)kind;
            assert_int_equal(open_all(0, &err), anew ? SH_EINPUT : SH_OK);
            assert_ptr_equal(at->datagrams, soak.datagrams[0]);
            if (anew)
                assert_string_equal(at->not_soaked,
                                    "its packets restart with power, plug or cable, so they can not be compared");
            free(at->fact);
            at->fact = NULL;
        }
    soak.faults.n = 1; /* the second is not in the list */
    soak.faults.fault[0].kind = FAULT_DROP;
    soak.faults.fault[1].kind = FAULT_CABLE;
    assert_int_equal(open_all(0, &err), SH_OK);
    close_all();
    assert_string_equal(trace, "close:none datagrams ");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(some_links_get_a_client, make_soak),
        cmocka_unit_test_setup(a_usb_link_needs_a_device_here, make_soak),
        cmocka_unit_test_setup(one_link_alone_is_asked_for, make_soak),
        cmocka_unit_test_setup(packets_are_compared, make_soak),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
