/* SPDX-License-Identifier: MIT */
/* Faults as data: when one strikes, also by chance; the list of a run; the truth as JSON and as text. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include <fcntl.h>
#include "core/err.h"
#include "firmware_sim/fault/board.h"
#include "firmware_sim/fault/tally.h"

static struct fault fault_of_kind(enum fault_kind kind)
{
    return (struct fault){
        .kind = kind, .from = 1, .every = 1, .probability = 1.0, .until_pulse = UINT64_MAX, .seed = 1, .byte = -1};
}

static void each_kind_has_its_name_and_place(void **state)
{
    (void)state;
    int places[4] = {0};
    for (int kind = 0; kind < FAULT_N_KINDS; kind++) {
        assert_non_null(fault_names[kind]);
        for (int other = 0; other < kind; other++)
            assert_string_not_equal(fault_names[kind], fault_names[other]);
        places[fault_place_of((enum fault_kind)kind)]++;
    }
    assert_null(fault_names[FAULT_N_KINDS]);
    assert_int_equal(places[FAULT_AT_FRAME], 17); /* as config/fault_rows.h has them */
    assert_int_equal(places[FAULT_AT_REPLY], 4);
    assert_int_equal(places[FAULT_AT_CONNECTION], 3);
}

/* In N trials with p the hits have sigma sqrt(N p (1 - p)). Beyond 5 sigma it is a false alarm in 6e-7 of all seeds.
 * The seeds are fixed, and so is the result. */
static void chance_is_as_likely_as_said(void **state)
{
    (void)state;
    enum { N = 200000 };
    static const double share[] = {0.0, 0.001, 0.03, 0.5, 0.97, 1.0};
    for (size_t i = 0; i < sizeof share / sizeof share[0]; i++) {
        struct fault f = fault_of_kind(FAULT_DROP);
        uint64_t hits = 0, twice = 0;
        int before = 0;
        f.probability = share[i];
        for (uint64_t number = 1; number <= N; number++) {
            const struct fault_spot spot = {.number = number};
            const int strikes = fault_strikes(&f, 1, 1, &spot);
            hits += (uint64_t)strikes;
            twice += (uint64_t)(strikes && before);
            before = strikes;
        }
        const double p = share[i], pp = p * p;
        assert_true(fabs((double)hits - N * p) <= 5.0 * sqrt(N * p * (1.0 - p)));
        /* Pairs of neighbours overlap, so they vary up to three times as much as N trials with p^2. */
        assert_true(fabs((double)twice - N * pp) <= 5.0 * sqrt(3.0 * N * pp * (1.0 - pp)) + 1.0);
    }
}

/* Two faults, links, seeds and draws are independent of each other. 64 bits agree in 32 +- 4. */
static void what_belongs_to_different_places_is_independent(void **state)
{
    (void)state;
    enum { N = 20000 };
    struct fault one = fault_of_kind(FAULT_DROP), other = one;
    other.seed = 2;
    uint64_t agree[5] = {0};
    for (uint64_t number = 1; number <= N; number++) {
        const uint64_t all[] = {fault_random(&one, 1, 1, number, 0), fault_random(&other, 1, 1, number, 0),
                                fault_random(&one, 2, 1, number, 0), fault_random(&one, 1, 2, number, 0),
                                fault_random(&one, 1, 1, number, 1), fault_random(&one, 1, 1, number + 1, 0)};
        for (int i = 0; i < 5; i++)
            agree[i] += (uint64_t)__builtin_popcountll(~(all[0] ^ all[i + 1]));
    }
    for (int i = 0; i < 5; i++) /* 5 sigma of 64 N fair coins */
        assert_true(fabs((double)agree[i] - 32.0 * N) <= 5.0 * 0.5 * sqrt(64.0 * N));
    assert_true(fault_random(&one, 1, 1, 7, 3) == fault_random(&one, 1, 1, 7, 3));
}

static void numbers_are_at_their_ends_as_said(void **state)
{
    (void)state;
    struct fault f = fault_of_kind(FAULT_DROP);
    struct fault_spot spot = {.number = UINT64_MAX};
    assert_true(fault_strikes(&f, 1, 1, &spot));
    f.until = UINT64_MAX;
    f.every = UINT64_MAX;
    assert_false(fault_strikes(&f, 1, 1, &spot));
    spot.number = 1;
    assert_true(fault_strikes(&f, 1, 1, &spot));
    f = fault_of_kind(FAULT_DROP);
    f.until_s = 2.0; /* before, not at */
    spot.t_ns = 1999999999;
    assert_true(fault_strikes(&f, 1, 1, &spot));
    spot.t_ns = 2000000000;
    assert_false(fault_strikes(&f, 1, 1, &spot));
    f = fault_of_kind(FAULT_DROP);
    f.until_pulse = 99;
    spot = (struct fault_spot){.number = 1, .has_pulses = 1, .pulse0 = 100, .n_pulses = 1};
    assert_false(fault_strikes(&f, 1, 1, &spot));
    spot.pulse0 = 99;
    assert_true(fault_strikes(&f, 1, 1, &spot));
    f.from_pulse = 99;
    spot.n_pulses = 0; /* a frame of points without a pulse */
    assert_false(fault_strikes(&f, 1, 1, &spot));
}

/* ---- the list of a run */

static uint32_t n_heard;

static void hear(void *ctx, const struct fault_note *note)
{
    assert_ptr_equal(ctx, &n_heard);
    n_heard += note->fault;
}

static void the_list_changes_and_counts_stay(void **state)
{
    (void)state;
    struct fault_list list = {.n = 2};
    struct fault_board *board;
    struct fault_entry entry[FAULT_MAX];
    struct sh_err err;
    uint32_t number, n;
    list.fault[0] = fault_of_kind(FAULT_DROP);
    list.fault[1] = fault_of_kind(FAULT_FLIP);
    assert_int_equal(fault_board_create(&list, NULL, NULL, &board, &err), SH_OK);
    fault_board_listen(board, hear, &n_heard);
    uint32_t version = fault_board_version(board);
    assert_true(version != 0);
    for (uint32_t i = 3; i <= FAULT_MAX; i++) {
        assert_int_equal(fault_board_add(board, &list.fault[0], 77, &number, &err), SH_OK);
        assert_int_equal(number, i);
    }
    assert_int_equal(fault_board_add(board, &list.fault[0], 77, &number, &err), SH_EINPUT);
    assert_string_equal(err.text, "there are 32 faults already; allowed 32");
    assert_int_equal(fault_board_end(board, 2, INT64_MIN), 1);
    assert_true(fault_board_version(board) != version);
    for (uint32_t i = 0; i < 3000; i++) { /* numbers go on, however many there were */
        assert_int_equal(fault_board_add(board, &list.fault[0], 78, &number, &err), SH_OK);
        fault_board_note(board, &(struct fault_note){.fault = number, .byte = -1});
        assert_int_equal(fault_board_end(board, number, INT64_MIN), 1);
    }
    assert_int_equal(fault_board_last(board), 3032);
    assert_int_equal(fault_board_injected(board, 1500), 1);
    assert_int_equal(fault_board_injected(board, 3032), 1);
    assert_int_equal(fault_board_injected(board, 3033), 0);
    assert_int_equal(fault_board_injected(board, 0), 3000);
    assert_int_equal(n_heard, (33u + 3032u) * 1500u);
    fault_board_note(board, &(struct fault_note){.fault = 1, .byte = -1, .ended = 1}); /* an end is no injection */
    assert_int_equal(fault_board_injected(board, 1), 0);
    assert_int_equal(fault_board_copy(board, entry, &n), fault_board_version(board));
    assert_int_equal(n, FAULT_MAX - 1);
    assert_true(entry[0].from_start && entry[0].number == 1 && entry[0].since_ns == 0);
    assert_true(!entry[1].from_start && entry[1].number == 3 && entry[1].since_ns == 77);
    assert_int_equal(fault_board_end(board, 0, INT64_MIN), FAULT_MAX - 1);
    assert_int_equal(fault_board_end(board, 0, INT64_MIN), 0);
    fault_board_free(board);
    fault_board_free(NULL);
    list.n = 0;
    assert_int_equal(fault_board_create(&list, NULL, NULL, &board, &err), SH_OK);
    assert_int_equal(fault_board_version(board), 0); /* there never was one */
    fault_board_free(board);
}

/* ---- the truth */

static const struct {
    struct fault_note note;
    const char *json, *text;
} notes[] = {
    {{.fault = 3,
      .kind = FAULT_FLIP,
      .t_ns = 12,
      .link = 1,
      .session = 2,
      .number = 7,
      .has_seq = 1,
      .seq = 4294967295u,
      .type = 3,
      .has_pulse = 1,
      .pulse = 900,
      .byte = 33,
      .bit = 6,
      .n = 2,
      .text = "resealed"},
     "{\"fault\":3,\"kind\":\"flip\",\"t_ns\":12,\"link\":1,\"session\":2,\"of\":\"stream\",\"frame\":7,\"seq\":4294967295,"
     "\"type\":3,\"pulse\":900,\"byte\":33,\"bit\":6,\"n\":2,\"text\":\"resealed\"}\n",
     "fault 3 flip: t_ns 12, link 1, session 2, stream 7, seq 4294967295, pulse 900, byte 33, n 2, resealed"},
    {{.fault = 1,
      .kind = FAULT_LATE_REPLY,
      .t_ns = 5,
      .link = 2,
      .session = 9,
      .of = FAULT_OF_REPLIES,
      .number = 1,
      .byte = -1,
      .for_ms = 12.5},
     "{\"fault\":1,\"kind\":\"late_reply\",\"t_ns\":5,\"link\":2,\"session\":9,\"of\":\"replies\",\"reply\":1,"
     "\"for_ms\":12.5}\n",
     "fault 1 late_reply: t_ns 5, link 2, session 9, replies 1, for 12.5 ms"},
    {{.fault = 2, .kind = FAULT_REFUSE, .t_ns = 0, .link = 1, .session = 1, .number = 4, .byte = -1},
     "{\"fault\":2,\"kind\":\"refuse\",\"t_ns\":0,\"link\":1,\"session\":1,\"connection\":4}\n",
     "fault 2 refuse: t_ns 0, link 1, session 1, connection 4"},
    {{.fault = 4, .kind = FAULT_CLOCK_STOP, .t_ns = 99, .byte = -1, .ended = 1},
     "{\"fault\":4,\"kind\":\"clock_stop\",\"t_ns\":99,\"ended\":true}\n",
     NULL},
};

static void the_truth_is_written_line_by_line(void **state)
{
    (void)state;
    char path[] = "/tmp/scanhead-truth-XXXXXX", got[4096] = "", want[4096] = "", text[TRUTH_TEXT_LEN];
    const int fd = mkstemp(path);
    struct truth *truth;
    struct sh_err err;
    assert_true(fd >= 0);
    unlink(path);
    assert_int_equal(truth_open(path, NULL, &truth, &err), SH_OK);
    for (size_t i = 0; i < sizeof notes / sizeof notes[0]; i++) {
        truth_write(truth, &notes[i].note);
        strcat(want, notes[i].json);
        truth_text(&notes[i].note, text);
        if (notes[i].text != NULL) assert_string_equal(text, notes[i].text);
    }
    assert_int_equal(truth_close(truth, &err), SH_OK);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    got[fread(got, 1, sizeof got - 1, file)] = '\0';
    fclose(file);
    unlink(path);
    close(fd);
    assert_string_equal(got, want);
}

static void a_dash_is_standard_output(void **state)
{
    (void)state;
    char got[512] = "";
    struct truth *truth;
    struct sh_err err;
    FILE *file = tmpfile();
    assert_non_null(file);
    fflush(stdout);
    const int was = dup(STDOUT_FILENO);
    assert_true(dup2(fileno(file), STDOUT_FILENO) >= 0);
    const int opened = truth_open("-", NULL, &truth, &err);
    if (opened == SH_OK) truth_write(truth, &notes[0].note);
    const int closed = opened == SH_OK ? truth_close(truth, &err) : SH_OK;
    const ssize_t n = pread(fileno(file), got, sizeof got - 1, 0);
    const int is_open = fcntl(STDOUT_FILENO, F_GETFD) >= 0;
    dup2(was, STDOUT_FILENO);
    close(was);
    fclose(file);
    assert_int_equal(opened, SH_OK);
    assert_int_equal(closed, SH_OK);
    assert_true(is_open && n > 0);
    assert_string_equal(got, notes[0].json);
    assert_int_not_equal(access("-", F_OK), 0);
}

/* The longest note is not cut. It fits into a line of the journal, which has notes as remarks. */
static void the_longest_note_is_not_cut(void **state)
{
    (void)state;
    char text[TRUTH_TEXT_LEN];
    struct fault_note note = {.fault = UINT32_MAX,
                              .kind = FAULT_DESCRIPTOR_LENGTH,
                              .t_ns = INT64_MIN,
                              .link = UINT32_MAX,
                              .session = UINT32_MAX,
                              .of = FAULT_OF_REPLIES,
                              .number = UINT64_MAX,
                              .has_seq = 1,
                              .seq = UINT32_MAX,
                              .has_pulse = 1,
                              .pulse = UINT64_MAX,
                              .byte = 65535,
                              .n = 1000000,
                              .for_ms = 1e-300 / 3.0};
    strcpy(note.text, "resealed");
    truth_text(&note, text);
    assert_true(strlen(text) > 150 && strlen(text) < TRUTH_TEXT_LEN - 1);
    assert_non_null(strstr(text, ", resealed"));
}

static void what_cannot_be_written_is_said(void **state)
{
    (void)state;
    struct truth *truth;
    struct sh_err err;
    assert_int_not_equal(truth_open("/nowhere/truth.json", NULL, &truth, &err), SH_OK);
    assert_null(truth);
    assert_non_null(strstr(err.text, "truth: "));
    assert_non_null(strstr(err.text, "/nowhere/truth.json"));
    assert_int_equal(truth_open("/dev/full", NULL, &truth, &err), SH_OK);
    truth_write(truth, &notes[0].note);
    assert_int_equal(truth_close(truth, &err), SH_EIO);
    assert_non_null(strstr(err.text, "truth: /dev/full: "));
    assert_int_equal(truth_open(NULL, NULL, &truth, &err), SH_OK); /* none was asked for */
    truth_write(truth, &notes[0].note);
    assert_int_equal(truth_close(truth, &err), SH_OK);
}

/* A client may add and clear faults on and on. The memory is that of one count for each fault that a run may have. */
static void a_run_has_a_bounded_number_of_faults(void **state)
{
    (void)state;
    struct fault_list list = {.n = 1};
    struct fault_board *board;
    struct sh_err err = {0};
    uint32_t number = 0;
    int rc = SH_OK;
    list.fault[0] = fault_of_kind(FAULT_DROP);
    assert_int_equal(fault_board_create(&list, NULL, NULL, &board, &err), SH_OK);
    for (uint32_t i = 0; i < FAULT_MOST_OF_A_RUN && rc == SH_OK; i++) {
        rc = fault_board_add(board, &list.fault[0], 0, &number, &err);
        if (rc == SH_OK) fault_board_end(board, number, INT64_MIN);
    }
    assert_int_equal(rc, SH_EINPUT);
    assert_string_equal(err.text, "there were 1000000 faults in this run; allowed 1000000; a new run counts anew");
    assert_int_equal(fault_board_last(board), FAULT_MOST_OF_A_RUN);
    fault_board_note(board, &(struct fault_note){.fault = FAULT_MOST_OF_A_RUN, .byte = -1});
    assert_int_equal(fault_board_injected(board, FAULT_MOST_OF_A_RUN), 1);
    fault_board_free(board);
}

static void items_are_found_by_their_number(void **state)
{
    (void)state;
    static const struct {
        uint32_t number;
        char rest[9];
    } item[3] = {{5, "a"}, {2, "b"}, {9, "c"}};
    for (uint32_t i = 0; i < 3; i++)
        assert_ptr_equal(fault_find(item, 3, sizeof *item, item[i].number), &item[i]);
    assert_null(fault_find(item, 3, sizeof *item, 3));
    assert_null(fault_find(item, 2, sizeof *item, 9)); /* beyond the last */
    assert_null(fault_find(item, 0, sizeof *item, 5));
}

/* A fault that is taken out is forgotten. Faults that stay keep their counts, wherever they are in the list. */
static void a_tally_keeps_what_is_in_the_list(void **state)
{
    (void)state;
    struct fault_tally tally = {{0}, {0}};
    struct fault_entry entry[3] = {{.number = 1}, {.number = 2}, {.number = 3}};
    for (uint32_t number = 1; number <= 3; number++)
        *fault_tally_hits(&tally, number) += 10 * number;
    entry[0].number = 3;
    entry[1].number = 2;
    fault_tally_renew(&tally, entry, 2);
    assert_int_equal(*fault_tally_hits(&tally, 2), 20);
    assert_int_equal(*fault_tally_hits(&tally, 3), 30);
    ++*fault_tally_hits(&tally, 4); /* in the place of fault 1, but not with its count */
    assert_int_equal(*fault_tally_hits(&tally, 4), 1);
    assert_int_equal(*fault_tally_hits(&tally, 3), 30);
    fault_tally_renew(&tally, entry, 0);
    for (uint32_t number = 1; number <= 4; number++)
        assert_int_equal(*fault_tally_hits(&tally, number), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_kind_has_its_name_and_place),
        cmocka_unit_test(chance_is_as_likely_as_said),
        cmocka_unit_test(what_belongs_to_different_places_is_independent),
        cmocka_unit_test(numbers_are_at_their_ends_as_said),
        cmocka_unit_test(the_list_changes_and_counts_stay),
        cmocka_unit_test(a_run_has_a_bounded_number_of_faults),
        cmocka_unit_test(items_are_found_by_their_number),
        cmocka_unit_test(a_tally_keeps_what_is_in_the_list),
        cmocka_unit_test(the_truth_is_written_line_by_line),
        cmocka_unit_test(a_dash_is_standard_output),
        cmocka_unit_test(the_longest_note_is_not_cut),
        cmocka_unit_test(what_cannot_be_written_is_said),
    };
    return cmocka_run_group_tests_name("faults", tests, NULL, NULL);
}
