/* SPDX-License-Identifier: MIT */
/* rawlog-grabber reads the ready configuration of a Hokuyo, over TCP and over a pty at once. Rates and times are those
 * of the device's own clock, nothing is lost, and ranges are right. The grabber also reads a URG-04LX, which is slower,
 * over its pty. */
#include "tests/wire/grabber.h"
#include "tests/wire/house.h"

struct model {
    int first, last, front, steps; /* as SCIP has them: AMIN, AMAX, AFRT, ARES */
    double min_m, max_m;
    int64_t period_100ns;
};
static const struct model UTM = {0, 1080, 540, 1440, 0.1, 30.0, 250000};
static const struct model URG = {44, 725, 384, 1024, 0.02, 5.6, 1000000};

/* The first ten scans have the host's times. From the eleventh on times are the device's, counted from that one. */
enum { BY_HOST = 10, SCANS = 30 };

static void check_scan(const struct house *house, const struct model *model, const struct rawlog_item *scan)
{
    assert_int_equal(scan->kind, RAWLOG_SCAN);
    assert_int_equal(scan->n, model->last - model->first + 1);
    assert_true(scan->right_to_left);
    for (uint32_t i = 0; i < scan->n; i++) {
        /* counter-clockwise from the front step */
        const double azimuth = -2.0 * M_PI * (model->first + (int)i - model->front) / model->steps;
        double range_m = scan->valid[i] ? rawlog_range_m(scan, i) : 0.0;
        /* half a millimetre is the rounding of the protocol, the rest that of float; 1e-7 rad is more than the rounding
         * of angles on both sides */
        if (!house_agrees(house, azimuth, 0.0, 1e-7, range_m, 0.000505, model->min_m, model->max_m))
            fail_msg("step %u: %.3f m instead of %.4f", i, range_m, house_range_m(house, azimuth, 0.0));
    }
}

static void check_log(const struct house *house, const struct model *model, const struct grabber *grabber, int n)
{
    struct rawlog log;
    rawlog_read(grabber, &log);
    if (strstr(grabber->said, "ERROR") != NULL) fail_msg("rawlog-grabber complains:\n%s", grabber->said);
    assert_true(log.n_items >= (uint32_t)n);
    check_scan(house, model, &log.item[0]);
    /* Nothing moves, and there is no noise. */
    for (uint32_t i = 1; i < log.n_items; i++) {
        assert_int_equal(log.item[i].n, log.item[0].n);
        assert_memory_equal(log.item[i].range, log.item[0].range, 4 * (size_t)log.item[0].n);
    }
    /* One tick of 100 ns is the rounding of seconds in double. */
    for (uint32_t i = BY_HOST + 1; i < log.n_items; i++) {
        int64_t step = log.item[i].t_100ns - log.item[i - 1].t_100ns;
        if (llabs(step - model->period_100ns) > 1)
            fail_msg("scan %u came %.4f ms after the last", i, (double)step / 1e4);
    }
    rawlog_free(&log);
}

/* The mark is on one side: its mirror images have other ranges. */
static void check_mark(const struct house *house)
{
    const double azimuth = atan2(1.1, 0.5);
    assert_true(house_is_mark(house, azimuth, 0.0));
    assert_false(house_is_mark(house, -azimuth, 0.0) || house_is_mark(house, azimuth + M_PI, 0.0));
    assert_true(fabs(house_range_m(house, azimuth, 0.0) - house_range_m(house, -azimuth, 0.0)) > 0.1);
}

/* Returns the driver's lines for link i. */
static const char *sensor_of(const struct head *head, int i)
{
    static char text[2][400];
    if (i == 0)
        snprintf(text[0], sizeof text[0], "driver = CHokuyoURG\nIP_DIR = 127.0.0.1\nPORT_DIR = %d\n",
                 endpoint_port(head_link(head, 0)));
    else
        snprintf(text[1], sizeof text[1], "driver = CHokuyoURG\nCOM_port_LIN = %s\n",
                 head_link(head, 1) + strlen("tty:"));
    return text[i];
}

/* A head refuses to measure while it boots, and this client asks only once. */
static void let_it_scan(const struct head *head)
{
    struct scanhead *sh = client_open(head_link(head, 2));
    client_wait_state(sh, "scanning");
    scanhead_close(sh);
    grabber_hurry(head->pid);
}

static void test_tcp_and_pty(void **state)
{
    struct wire *wire = *state;
    static struct grabber tcp, pty;
    grabber_or_skip();
    const char *const more[] = {"--set", "links.0.port=0", NULL};
    struct head head = head_start(wire, "config/hokuyo.yaml", house_options(wire, "13", more));
    struct house *house = house_load(wire);
    check_mark(house);
    let_it_scan(&head);
    grabber_start_and_wait(wire, "TCP", sensor_of(&head, 0), 1, &tcp);
    grabber_start_and_wait(wire, "PTY", sensor_of(&head, 1), SCANS, &pty);
    if (!grabber_wait(&tcp, SCANS)) fail_msg("rawlog-grabber complains:\n%s", tcp.said);
    grabber_end(&tcp);
    grabber_end(&pty);
    head_end(&head, SIGTERM);
    check_log(house, &UTM, &tcp, SCANS);
    check_log(house, &UTM, &pty, SCANS);
    house_free(house);
}

static void test_urg(void **state)
{
    struct wire *wire = *state;
    static struct grabber pty;
    grabber_or_skip();
    const char *const more[] = {"--set", "links.0.port=0", "--set", "head.profile=hokuyo-urg-04lx", NULL};
    struct head head = head_start(wire, "config/hokuyo.yaml", house_options(wire, "13", more));
    struct house *house = house_load(wire);
    let_it_scan(&head);
    grabber_start_and_wait(wire, "URG", sensor_of(&head, 1), BY_HOST + 4, &pty);
    grabber_end(&pty);
    head_end(&head, SIGTERM);
    check_log(house, &URG, &pty, BY_HOST + 4);
    house_free(house);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_tcp_and_pty, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_urg, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
