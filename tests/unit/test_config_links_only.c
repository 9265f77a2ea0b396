/* SPDX-License-Identifier: MIT */
/* A replay has a configuration of links, loop and faults alone. Its defaults are those of a whole one, and its errors
 * are compared word for word. */
#include "firmware_sim/config/load.h"
#include "tests/unit/config_rig.h"

#include "drivers/protocol/protocol.h"

static int load(const char *text, const char *const *sets, int n)
{
    memset(&err, 0, sizeof err);
    const int rc = config_load_links(text, "--link", sets, n, cfg, &diagnostics);
    if (rc != SH_OK) err = diagnostics.err[0];
    return rc;
}

static void links_loop_and_faults_are_taken(void **state)
{
    (void)state;
    static const char *const sets[] = {"links.1.port=7", "loop.queue_ms=100", "links.2.type=null"};
    memset(cfg, 0xff, sizeof *cfg);
    assert_loads(load("links: [{type: tcp, port: 5}, {type: tcp, protocol: scip}]\nloop: {tick_hz: 500}\n"
                      "faults: [{kind: drop, link: 1}, {kind: window_soiled}]\n",
                      sets, 3));
    assert_string_equal(cfg->file, "--link");
    assert_int_equal(cfg->has_no_head, 1);
    assert_int_equal(cfg->n_links, 3);
    assert_true(cfg->link[0].port == 5 && cfg->link[1].port == 7 && cfg->link[2].type == LINK_NULL);
    assert_true(cfg->link[1].max_sessions == 1 && cfg->link[0].max_sessions == 4); /* a Hokuyo has one client */
    assert_true(cfg->loop.tick_hz == 500.0 && cfg->loop.queue_ms == 100.0);
    assert_true(cfg->faults.n == 2 && cfg->faults.fault[0].kind == FAULT_DROP && cfg->faults.fault[0].link == 1);
    assert_true(cfg->n_stations == 0 && cfg->scene.n_meshes == 0 && cfg->profile.name[0] == '\0');
    /* The defaults are those of a whole configuration. */
    const struct config_loop loop = cfg->loop;
    const struct link_spec link = cfg->link[0];
    assert_loads(load_edited("    port: 0\n", "    port: 5\n"));
    assert_true(loop.ahead_ms == cfg->loop.ahead_ms && loop.late_ms == cfg->loop.late_ms);
    assert_true(loop.pace == cfg->loop.pace && loop.threads == cfg->loop.threads);
    assert_memory_equal(&link, &cfg->link[0], sizeof link);
    assert_loads(load("{}", NULL, 0));
    assert_true(cfg->n_links == 0 && cfg->faults.n == 0 && cfg->loop.tick_hz == 1000.0);
}

static void each_check_is_made(void **state)
{
    (void)state;
    static const struct {
        const char *text, *set, *says;
    } wrong[] = {
        {"links: [{type: tcp, port: 5}, {type: tcp, port: 5}]", NULL,
         "--link:1: links[1].port: links[0] listens on the same port; allowed a port of its own, or 0"},
        {"links: [{type: file}]", NULL,
         "--link:1: links[0].path: missing; a file link requires the path of the file to write"},
        {"links: [{type: udp, port: 5, protocol: scip}]", NULL,
         "--link:1: links[0].protocol: protocol scip is not available on a udp link; allowed pty, tcp, usb"},
        {"{}", "loop.tick_hz=999",
         "--set loop.tick_hz: 999 does not divide 1e9; allowed a divisor of 1e9 from 100 to 10000 Hz, such as 500, 1000, "
         "2000"},
        {"faults: [{kind: drop, n: 2}]", NULL,
         "--link:1: faults[0].n: drop has no such key; allowed only keys that say when and where"},
        {"links: [{type: tcp}]\nfaults: [{kind: drop, link: 2}]", NULL,
         "--link:2: faults[0].link: there is no link 2; allowed 0 to 1"},
        {"links: [{type: tcp}]\nfaults: [{kind: slow_enumeration, link: 1, for_ms: 5}]", NULL,
         "--link:2: faults[0].link: link 1 can't have slow_enumeration; allowed 0, or a link that can"},
        {"head: {}", NULL, "--link:1: head: unknown key; allowed links, loop, faults"},
        {"{}", "head.prr_hz=5", "--set head.prr_hz: unknown key; allowed links, loop, faults"},
        {"{}", "stations.0.scanner.head=1", "--set stations.0.scanner.head: unknown key; allowed links, loop, faults"},
        {"", NULL, "--link:1: empty; a section with keys is needed"},
        {"[]", NULL, "--link:1: here stands a list; allowed sections with keys"},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        const int rc = load(wrong[i].text, &wrong[i].set, wrong[i].set != NULL);
        if (rc != SH_EINPUT) fail_msg("%s, %s: taken", wrong[i].text, wrong[i].set != NULL ? wrong[i].set : "");
        if (strcmp(err.text, wrong[i].says) != 0) fail_msg("\"%s\"\nexpected \"%s\"", err.text, wrong[i].says);
        if (diagnostics.n != 1) fail_msg("%s; also %s", wrong[i].says, diagnostics.err[1].text);
    }
}

/* The first of many is what the call returns. */
static void all_errors_are_told(void **state)
{
    (void)state;
    assert_int_equal(load("links: [{type: x}]\nloop: {tick_hz: y, ahead_ms: 1}\n", NULL, 0), SH_EINPUT);
    assert_int_equal(diagnostics.n, 3);
    static const char first[] = "--link:1: links[0].type: \"x\" is not known; allowed null, ";
    assert_int_equal(strncmp(diagnostics.err[0].text, first, sizeof first - 1), 0);
    assert_string_equal(diagnostics.err[2].text, "--link:2: loop.ahead_ms: \"1\" is out of range; allowed 2 to 90 ms");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(links_loop_and_faults_are_taken),
        cmocka_unit_test(each_check_is_made),
        cmocka_unit_test(all_errors_are_told),
    };
    return cmocka_run_group_tests_name("links alone", tests, set_up, tear_down);
}
