/* SPDX-License-Identifier: MIT */
/* A run says at its end what it did: each member of its statistics, of its links and of its endpoints, and the
 * warnings, is compared here. The test gives the source's counters numbers that all differ. */
#include "firmware_sim/app/run/run.h"
#include "tests/unit/device_rig.h"
#include "tests/unit/output_rig.h"
#include "tests/unit/plain_source.h"

#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>

#include "firmware_sim/base/clock.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/keys.h"
#include "firmware_sim/loop/loop_inside.h"
#include "firmware_sim/loop/pump_inside.h"

static const struct device_counters COUNTERS = {.fired = 2000,
                                                .cast = 1900,
                                                .pulses = 1000,
                                                .echoes = 60,
                                                .lines = 17,
                                                .empty = 960,
                                                .lost_pulses = 31,
                                                .lost_ticks = 3,
                                                .crowded = 41,
                                                .faint = 43,
                                                .unfit = 47,
                                                .lost_samples = 53,
                                                .late_blocks = 5,
                                                .reader_lost_frames = 59,
                                                .reader_lost_pulses = 61,
                                                .late_poses = 67,
                                                .bad_poses = 71,
                                                .lost_journal_lines = 73,
                                                .lost_truth_lines = 79};

static const struct link_counts LINKS[2] = {{1, 2, 3, 4, 5, 6, 7, 8, 9}, {11, 12, 13, 14, 15, 16, 17, 18, 19}};

/* A run with two links and one more within this process. The run ends at once. */
struct stats_run {
    struct plain_source source;
    struct loop *loop;
    struct rig *rig;
    int fd;
    char stats[128], file[128]; /* file: that of the second link */
};

static void stats_run_open(struct stats_run *run, int hash)
{
    char path[160];
    const char *const sets[] = {"loop.pace=fast", "links[0].type=null", "links[1].type=file", path};
    struct sh_err err;
    int fd[2];
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, fd), 0);
    const struct link_spec extra = {.type = LINK_FD, .fd = fd[0]};
    const struct loop_options options = {.hash = hash, .extra = &extra, .report = &app_report_stderr};
    const struct loop_source source = {&plain_source_ops, &run->source};
    run->fd = fd[1];
    snprintf(run->file, sizeof run->file, "%s/out.bin", folder);
    snprintf(path, sizeof path, "links[1].path=%s", run->file);
    run->rig = rig_open(NULL, sets, 4);
    snprintf(run->stats, sizeof run->stats, "%s/stats.json", folder);
    need(loop_create_of(run->rig->cfg, &source, &options, &run->loop, &err), &err);
}

static void stats_run_close(struct stats_run *run)
{
    loop_free(run->loop);
    close(run->fd);
    unlink(run->stats);
    unlink(run->file);
    rig_close(run->rig);
}

/* Sets the numbers when the run is over, since its links count up to then. */
static void set_counters(struct plain_source *source)
{
    struct stats_run *run = (struct stats_run *)source; /* its first member */
    source->counters = COUNTERS;
    for (int i = 0; i < 2; i++)
        run->loop->links.pump[i]->counts = LINKS[i];
}

/* Serves it to its end. Returns what was printed to standard error; free it. */
static char *serve(struct stats_run *run, struct run_options *options)
{
    struct sh_err err = {0};
    struct output output;
    output_take(&output, stderr);
    const int rc = run_serve(options, run->loop, &err);
    app_end_messages();
    char *said = output_give(&output);
    need(rc, &err);
    assert_int_equal(run->source.n_closed, 1);
    return said;
}

static void read_text(const char *path, char *text, size_t room)
{
    FILE *f = fopen(path, "r");
    assert_non_null(f);
    const size_t n = fread(text, 1, room - 1, f);
    fclose(f);
    text[n] = '\0';
}

/* The member stands in the text, once. */
static void expect_member(const char *text, const char *member)
{
    const char *at = strstr(text, member);
    if (at == NULL || strstr(at + 1, member) != NULL) fail_msg("not once: %s\n%s", member, text);
}

/* Returns the number of a member. */
static double number_of(const char *text, const char *key)
{
    char name[64];
    snprintf(name, sizeof name, "\n  \"%s\": ", key);
    const char *at = strstr(text, name);
    if (at == NULL) fail_msg("no %s", key);
    return strtod(at + strlen(name), NULL);
}

/* Notes 10,000 latenesses: 5,100 of first_ns, 4,850 of a nanosecond more, 45 of 2 ns more and 5 of 3 ns more. Up to
 * 64 ns each has a bin of its own (lateness.h). */
static void note_all(struct lateness *lateness, int64_t first_ns)
{
    static const int n[] = {5100, 4850, 45, 5};
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < n[i]; k++)
            lateness_note(lateness, first_ns + i);
}

static const char MEMBERS[] = "{\n  \"pulses\": 1000,\n  \"fired_pulses\": 2000,\n  \"blind_pulses\": 100,\n"
                              "  \"cast_pulses\": 1900,\n  \"lost_pulses\": 31,\n  \"lost_ticks\": 3,\n"
                              "  \"echoes\": 60,\n  \"lines\": 17,\n  \"scans\": 7,\n  \"wall_s\": 2.5,\n";
static const char MORE[] = "\n  \"pulses_per_s\": 400,\n  \"crowded_echoes\": 41,\n  \"faint_hits\": 43,\n"
                           "  \"unfit_echoes\": 47,\n  \"lost_samples\": 53,\n  \"reader_lost_frames\": 59,\n"
                           "  \"reader_lost_pulses\": 61,\n  \"late_blocks\": 5,\n  \"late_poses\": 67,\n"
                           "  \"bad_poses\": 71,\n  \"lost_journal_lines\": 73,\n  \"lost_truth_lines\": 79,\n"
                           "  \"late_p50_us\": 0.001,\n  \"late_p99_us\": 0.002,\n  \"late_p999_us\": 0.003,\n"
                           "  \"late_max_us\": 0.004,\n  \"late_below_ns\": {\n    \"32\": 10000\n  },\n"
                           "  \"wake_p50_us\": 0.041,\n  \"wake_p99_us\": 0.042,\n  \"wake_p999_us\": 0.043,\n"
                           "  \"wake_max_us\": 0.044,\n  \"wake_below_ns\": {\n    \"64\": 10000\n  },\n";
static void expect_links(const char *text, const char *file)
{
    char ends[2048];
    snprintf(ends, sizeof ends,
             ",\n  \"stream_sha256\": null,\n  \"links\": [\n"
             "    {\n      \"endpoint\": \"null\",\n      \"protocol\": \"native\",\n"
             "      \"received_pulses\": 1,\n      \"left_out_pulses\": 2,\n      \"left_out_frames\": 3,\n"
             "      \"sent_units\": 4,\n      \"lost_units\": 5,\n      \"lost_points\": 6,\n"
             "      \"unsent_pulses\": 7,\n      \"wrong_requests\": 8,\n      \"lost_input_bytes\": 9\n    },\n"
             "    {\n      \"endpoint\": \"file:%s\",\n      \"protocol\": \"native\",\n"
             "      \"received_pulses\": 11,\n      \"left_out_pulses\": 12,\n      \"left_out_frames\": 13,\n"
             "      \"sent_units\": 14,\n      \"lost_units\": 15,\n      \"lost_points\": 16,\n"
             "      \"unsent_pulses\": 17,\n      \"wrong_requests\": 18,\n      \"lost_input_bytes\": 19\n    },\n",
             file);
    expect_member(text, ends);
}

static void each_member_has_its_own_number(void **state)
{
    (void)state;
    struct stats_run run = {.source = {.closed = set_counters, .n_scans = 7}};
    struct run_options options = {.stats = run.stats};
    struct rusage before, after;
    static char text[8192];
    stats_run_open(&run, 0);
    atomic_store(&run.loop->stream.first_pulse_ns, 1000000000);
    atomic_store(&run.loop->stream.last_pulse_ns, 3500000000);
    note_all(&run.loop->pacer.pace.late, 1);
    note_all(&run.loop->pacer.pace.wake, 41);
    getrusage(RUSAGE_SELF, &before);
    const double cpu_s = clock_cpu_s();
    free(serve(&run, &options));
    getrusage(RUSAGE_SELF, &after);
    read_text(run.stats, text, sizeof text);
    expect_member(text, MEMBERS);
    expect_member(text, MORE);
    expect_links(text, run.file);
    assert_true(number_of(text, "cpu_s") >= cpu_s && number_of(text, "cpu_s") <= clock_cpu_s());
    const double rss_kib = number_of(text, "rss_peak_kib");
    assert_true(rss_kib >= (double)before.ru_maxrss && rss_kib <= (double)after.ru_maxrss);
    stats_run_close(&run);
}

/* Without a pulse there is no rate. The hash of no frame is that of no byte (FIPS 180-4, SHA-256 of the empty
 * message). */
static void a_run_without_pulses_has_a_hash_and_no_rate(void **state)
{
    (void)state;
    struct stats_run run = {.source = {.n_scans = 0}};
    struct run_options options = {.stats = run.stats};
    static char text[8192];
    stats_run_open(&run, 1);
    char *said = serve(&run, &options);
    assert_string_equal(said, "");
    free(said);
    read_text(run.stats, text, sizeof text);
    expect_member(text, "\n  \"wall_s\": 0,\n");
    expect_member(text, "\n  \"pulses_per_s\": 0,\n");
    expect_member(text, "\n  \"late_max_us\": 0,\n  \"late_below_ns\": {},\n");
    expect_member(text, "\"e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855\"");
    stats_run_close(&run);
}

static void losses_are_warned_of_with_their_numbers(void **state)
{
    (void)state;
    static const char *const says[] = {
        "warning: 31 pulses could not be computed in time\n",
        "warning: 41 echoes left out, the weakest ones: their pulses had more echoes than the head's max_echoes\n",
        "warning: 47 echoes left out, too far from the anchor for the stream's integers\n",
        "warning: 53 samples of waveforms left out: their pulses had more than there is room for\n",
        "warning: mostly empty: 40 of 1000 pulses have an echo, 4 %; 43 hits were not detected\n",
        "warning: readers lost 59 frames with 61 pulses\n",
        "warning: journal: 73 lines are missing in its file; they could not be written in time\n",
        "warning: truth: 79 lines are missing in its file; they could not be written in time\n"};
    struct stats_run run = {.source = {.closed = set_counters}};
    struct run_options options = {.stats = NULL};
    stats_run_open(&run, 0);
    char *said = serve(&run, &options);
    for (size_t i = 0; i < sizeof says / sizeof says[0]; i++)
        expect_member(said, says[i]);
    free(said);
    assert_int_equal(access(run.stats, F_OK), -1);
    stats_run_close(&run);
}

/* A twentieth of the pulses is the limit: with just that many echoes nothing is said. */
static void few_echoes_are_a_warning_below_a_twentieth(void **state)
{
    (void)state;
    for (uint64_t empty = 950; empty <= 951; empty++) {
        struct output output;
        output_take(&output, stderr);
        app_warn_empty(1000, empty, 0);
        char *said = output_give(&output);
        assert_int_equal(strstr(said, "mostly empty: 49 of 1000") != NULL, empty == 951);
        assert_int_equal(said[0] == '\0', empty == 950);
        free(said);
    }
}

/* The line leaves out the link within this process, since no other program can open it. */
static void the_ready_line_has_the_endpoints(void **state)
{
    (void)state;
    struct stats_run run = {.source = {.n_scans = 0}};
    char text[1024], want[512];
    int fd[2];
    assert_int_equal(pipe(fd), 0);
    struct run_options options = {.ready_fd = fd[1]};
    stats_run_open(&run, 0);
    free(serve(&run, &options));
    const ssize_t n = read(fd[0], text, sizeof text - 1);
    assert_true(n > 0);
    text[n] = '\0';
    snprintf(want, sizeof want,
             "{\"endpoints\":[{\"type\":\"null\",\"endpoint\":\"null\",\"protocol\":\"native\"},"
             "{\"type\":\"file\",\"endpoint\":\"file:%s\",\"protocol\":\"native\"}]}\n",
             run.file);
    assert_string_equal(text, want);
    assert_int_equal(read(fd[0], text, sizeof text), 0); /* it is closed, so that nothing else goes there */
    close(fd[0]);
    stats_run_close(&run);
}

static void a_message_of_a_link_has_its_name(void **state)
{
    (void)state;
    struct stats_run run = {.source = {.n_scans = 0}};
    struct output output;
    struct sh_err err;
    struct loop_stats stats;
    char want[256];
    stats_run_open(&run, 0);
    output_take(&output, stderr);
    pump_say(run.loop->links.pump[1], "its reader sleeps");
    char *said = output_give(&output);
    snprintf(want, sizeof want, "scanhead: warning: link file:%s: its reader sleeps\n", run.file);
    assert_non_null(strstr(said, want));
    free(said);
    loop_end(run.loop);
    loop_join(run.loop, &stats);
    need(loop_close_files(run.loop, &stats, &err), &err);
    stats_run_close(&run);
}

/* ---- real time */

static enum loop_source_tick until_it_ends(struct plain_source *self, uint64_t tick, int again, struct ring_tick *out)
{
    (void)tick, (void)again, (void)out;
    return atomic_load(&self->ending) ? LOOP_SOURCE_OVER : LOOP_SOURCE_TICK;
}

/* The limit that the service's unit gives (config/packaging). */
static int limit_of_unit(void)
{
    char line[256];
    int limit = 0;
    FILE *f = fopen("config/packaging/scanhead@.service.in", "r");
    assert_non_null(f);
    while (fgets(line, sizeof line, f) != NULL)
        if (sscanf(line, "LimitRTPRIO=%d", &limit) == 1) break;
    fclose(f);
    assert_true(limit > 0);
    return limit;
}

/* The pacing thread has the priority that the service's unit allows. Where the system does not allow it here, the
 * warning has that number. */
static void the_pacing_thread_has_the_allowed_priority(void **state)
{
    (void)state;
    static const struct link_spec null_link = {.type = LINK_NULL};
    const struct loop_options options = {.extra = &null_link, .report = &app_report_stderr};
    struct plain_source source = {.next = until_it_ends};
    const struct loop_source self = {&plain_source_ops, &source};
    struct rig *rig = rig_open(NULL, NULL, 0);
    struct loop *loop;
    struct loop_stats stats;
    struct output output;
    struct sched_param param;
    struct sh_err err;
    char want[64];
    int policy;
    need(loop_create_of(rig->cfg, &self, &options, &loop, &err), &err);
    output_take(&output, stderr);
    const int rc = loop_start(loop, &err);
    char *said = output_give(&output);
    need(rc, &err);
    assert_int_equal(pthread_getschedparam(loop->pacer.thread, &policy, &param), 0);
    loop_end(loop);
    loop_join(loop, &stats);
    loop_free(loop);
    munlockall(); /* the loop locks its memory */
    rig_close(rig);
    snprintf(want, sizeof want, "raise RLIMIT_RTPRIO to %d\n", limit_of_unit());
    if (policy == SCHED_FIFO)
        assert_int_equal(param.sched_priority, limit_of_unit());
    else
        assert_non_null(strstr(said, want));
    free(said);
}

/* ---- the link of --view */

/* The added page takes as many clients as a web link of a configuration that does not give their number. */
static void view_adds_a_page_where_there_is_none(void **state)
{
    (void)state;
    struct config *cfg = calloc(1, sizeof *cfg);
    const struct run_options options = {.view = 1}, none = {.view = 0};
    struct sh_err err = {0};
    assert_non_null(cfg);
    strcpy(cfg->file, "here.yaml");
    assert_int_equal(run_complete_links(&none, cfg, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "here.yaml: links: none; "));
    need(run_complete_links(&options, cfg, &err), &err);
    assert_true(cfg->n_links == 1 && cfg->link[0].type == LINK_WEB);
    const char *usual = cfg_find(&cfg_config_table, "links[].max_sessions")->def;
    assert_int_equal(cfg->link[0].max_sessions, atoi(usual));
    need(run_complete_links(&options, cfg, &err), &err); /* now there is one */
    assert_int_equal(cfg->n_links, 1);
    need(run_complete_links(&none, cfg, &err), &err);
    free(cfg);
}

static void view_needs_a_place_among_the_links(void **state)
{
    (void)state;
    struct config *cfg = calloc(1, sizeof *cfg);
    const struct run_options options = {.view = 1};
    struct sh_err err = {0};
    assert_non_null(cfg);
    strcpy(cfg->file, "here.yaml");
    for (cfg->n_links = 0; cfg->n_links < CONFIG_MAX_LINKS - 1; cfg->n_links++)
        cfg->link[cfg->n_links].type = LINK_NULL;
    need(run_complete_links(&options, cfg, &err), &err); /* the last place */
    assert_int_equal(cfg->link[CONFIG_MAX_LINKS - 1].type, LINK_WEB);
    need(run_complete_links(&options, cfg, &err), &err); /* the page is there already: the last link */
    cfg->link[CONFIG_MAX_LINKS - 1].type = LINK_NULL;
    assert_int_equal(run_complete_links(&options, cfg, &err), SH_EINPUT);
    assert_string_equal(err.text, "here.yaml: links: with --view there is one more than the allowed 8");
    assert_int_equal(cfg->n_links, CONFIG_MAX_LINKS);
    free(cfg);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_member_has_its_own_number),
        cmocka_unit_test(a_run_without_pulses_has_a_hash_and_no_rate),
        cmocka_unit_test(losses_are_warned_of_with_their_numbers),
        cmocka_unit_test(few_echoes_are_a_warning_below_a_twentieth),
        cmocka_unit_test(the_ready_line_has_the_endpoints),
        cmocka_unit_test(a_message_of_a_link_has_its_name),
        cmocka_unit_test(the_pacing_thread_has_the_allowed_priority),
        cmocka_unit_test(view_adds_a_page_where_there_is_none),
        cmocka_unit_test(view_needs_a_place_among_the_links),
    };
    return cmocka_run_group_tests_name("run's end", tests, make_folder, remove_folder);
}
