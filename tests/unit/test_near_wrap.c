/* SPDX-License-Identifier: MIT */
/* Counters begin near their wrap, as a fault on request sets them. They pass it as the protocol's page says. */
#include "tests/unit/cola_rig.h"
#include "tests/unit/scip_rig.h"

/* Opens the session anew, with counters so far below their wrap. */
static void open_again(struct protocol_rig *r, uint32_t near_wrap)
{
    struct sh_err err;
    protocol_destroy(r->ops, r->protocol);
    r->spec.near_wrap = near_wrap;
    assert_int_equal(protocol_create(r->ops, &r->spec, &r->protocol, &err), 0);
    r->ops->open(r->protocol, 0);
    protocol_rig_describe(r, 0);
    protocol_rig_clear(r);
}

/* Telegrams and scans have 16 bits, 3 below the wrap. Telegrams begin with the session, scans with the head's first
 * turn. */
static void cola_counts_telegrams_and_scans(void **state)
{
    (void)state;
    struct cola_lmd lmd;
    cola_open_tim("TiM571");
    open_again(&cola, 3);
    for (uint32_t line = 0; line < 2; line++)
        cola_turn(line, 1.0); /* before the client asks */
    cola_stream(1);
    protocol_rig_clear(&cola);
    for (uint32_t i = 0; i < 6; i++) {
        static const uint32_t telegrams[] = {65533, 65534, 65535, 0, 1, 2}, scans[] = {65535, 0, 1, 2, 3, 4};
        cola_turn(2 + i, 1.0);
        cola_read_lmd(i, &lmd);
        assert_int_equal(lmd.telegram, telegrams[i]);
        assert_int_equal(lmd.scan, scans[i]);
    }
    cola_expect("sMN SetAccessMode 3 F4724744", "sAN SetAccessMode 1");
    cola_expect("sMN mSCreboot", "sAN mSCreboot"); /* a power-up: the counter of telegrams begins again */
    cola_stream(1);
    protocol_rig_clear(&cola);
    cola_turn(8, 1.0);
    cola_read_lmd(0, &lmd);
    assert_int_equal(lmd.telegram, 65533);
}

/* Times are us in 32 bits, 2 s below the wrap, so that they wrap 2 s after power-up. Turns begin at 1.8 s, 15 a
 * second. */
static void cola_times_pass_the_wrap(void **state)
{
    (void)state;
    struct cola_lmd lmd;
    cola_open_tim("TiM571");
    open_again(&cola, 2000000);
    cola.scan_t0_ns = INT64_C(1800000000);
    cola_stream(1);
    protocol_rig_clear(&cola);
    for (uint32_t line = 0; line < 6; line++) {
        cola_turn(line, 1.0);
        cola_read_lmd(line, &lmd);
        const int64_t start_us = 1800000 + (int64_t)line * 1000000 / 15,
                      end_us = 1800000 + (int64_t)(line + 1) * 1000000 / 15;
        assert_int_equal(lmd.scan_us, (start_us - 2000000 + INT64_C(4294967296)) % INT64_C(4294967296));
        assert_int_equal(lmd.send_us, (end_us - 2000000 + INT64_C(4294967296)) % INT64_C(4294967296));
    }
    char now[64]; /* 2.2 s: 200,000 us, which are 30D40 */
    snprintf(now, sizeof now, "sRA LIDoutputstate 0 30D40 ");
    assert_int_equal(strncmp(cola_ask("sRN LIDoutputstate"), now, strlen(now)), 0);
}

/* Opens a SCIP head 75 ms below the wrap, and takes six turns of 25 ms, the first at t0_ns. */
static void turn_past_the_wrap(int64_t t0_ns)
{
    static struct scip_decoded scan;
    scip_open("UTM-30LX");
    open_again(&rig, 75);
    rig.scan_t0_ns = t0_ns;
    scip_ask("MD0000108000000\n", "MD0000108000000\n00P\n\n");
    for (uint32_t line = 0; line < 6; line++) {
        scip_turn(line);
        scip_decode_only(&scan, 3, 0);
        assert_int_equal(scan.time_ms, (line * 25 + 0x1000000 - 75) % 0x1000000);
        protocol_rig_clear(&rig);
    }
}

/* The time stamp is ms in 24 bits. The fourth of the turns begins at the wrap. Parts of a millisecond do not count,
 * before the wrap either: a turn 74.7 ms before it has the stamp of one 75 ms before. */
static void scip_times_pass_the_wrap(void **state)
{
    (void)state;
    turn_past_the_wrap(300000);
    turn_past_the_wrap(0);
    /* RS sets it to 0, as always. After a reboot it begins as at power-up. */
    scip_ask("RS\nTM0\nTM1\nTM2\n", "RS\n00P\n\nTM0\n00P\n\nTM1\n00P\n00000\n\nTM2\n00P\n\n");
    scip_ask("RB\nRB\n", "RB\n01Q\n\nRB\n00P\n\n");
    rig.ops->time(rig.protocol, INT64_C(1150000000)); /* 1 s later */
    assert_string_equal(rig.line[rig.n_lines - 1], "HEAD:REBOOT");
    rig.spec.power_ns = INT64_C(1150000000);
    open_again(&rig, 75);
    rig.ops->time(rig.protocol, rig.spec.power_ns);
    scip_ask("TM0\nTM1\n", "TM0\n00P\n\nTM1\n00P\noonea\n\n"); /* 2^24 - 75: 63, 63, 62, 53 */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(cola_counts_telegrams_and_scans, cola_teardown),
        cmocka_unit_test_teardown(cola_times_pass_the_wrap, cola_teardown),
        cmocka_unit_test(scip_times_pass_the_wrap),
    };
    return cmocka_run_group_tests(tests, NULL, scip_teardown);
}
