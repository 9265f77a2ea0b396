/* SPDX-License-Identifier: MIT */
/* `record --raw`: pieces that came at several sockets are passed on in their order, whenever they are asked for. And
 * the escapes of --send. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>

#include "core/rng.h"
#include "firmware_sim/app/studio/record/raw.h"
#include "firmware_sim/app/studio/record/raw_order.h"

enum { INPUTS = 3, PIECES = 3000 };

/* In this world a piece comes at each step of a clock, at one of the sockets. The clock may go on just before a socket
 * is asked. */
struct world {
    int64_t now;
    uint64_t asked;
    int n_passed, failing;
    int64_t last;
};

struct socket {
    struct raw_input input;
    struct world *world;
    int number;
    int64_t next; /* pieces before it were taken */
};

static int owner_of(int64_t piece)
{
    return (int)(rng_u64(1, (uint64_t)piece) % INPUTS);
}

static int take(struct raw_input *input, struct sh_err *err)
{
    struct socket *s = (struct socket *)input;
    struct world *w = s->world;
    (void)err;
    w->now += (int64_t)(rng_u64(2, w->asked++) % 4 == 0);
    if (w->failing) return SH_EIO;
    while (s->next < w->now && s->next < PIECES && owner_of(s->next) != s->number)
        s->next++;
    if (s->next >= w->now || s->next >= PIECES) return 0;
    input->t_ns = s->next++;
    return 1;
}

static int pass(struct raw_input *input, struct sh_err *err)
{
    struct world *w = ((struct socket *)input)->world;
    (void)err;
    assert_int_equal(input->t_ns, w->last + 1);
    w->last = input->t_ns;
    w->n_passed++;
    return SH_OK;
}

static void test_order(void **state)
{
    (void)state;
    struct world w = {.last = -1};
    struct socket socket[INPUTS];
    struct raw_input *input[INPUTS];
    struct sh_err err;
    for (int i = 0; i < INPUTS; i++) {
        socket[i] = (struct socket){.input = {.take = take, .pass = pass}, .world = &w, .number = i};
        input[i] = &socket[i].input;
    }
    while (w.n_passed < PIECES)
        assert_in_range(raw_pass_in_order(input, INPUTS, 7, &err), 0, 7);
    assert_int_equal(raw_pass_in_order(input, INPUTS, 7, &err), 0);
    w.failing = 1;
    assert_int_equal(raw_pass_in_order(input, INPUTS, 7, &err), SH_EIO);
}

static void check_bytes(const char *text, const char *bytes, size_t n)
{
    uint8_t out[64];
    size_t len;
    assert_null(raw_unescape(text, out, &len));
    assert_int_equal(len, n);
    assert_memory_equal(out, bytes, n);
}

static void test_escapes(void **state)
{
    (void)state;
    static const char *const wrong[] = {"", "\\", "a\\", "\\y", "\\x", "\\x1", "\\x1g", "\\xg1", "\\8", "\\N"};
    uint8_t out[64];
    size_t len;
    check_bytes("*IDN?\\n", "*IDN?\n", 6);
    check_bytes("\\x02sRN\\x03", "\2sRN\3", 5);
    check_bytes("\\0\\r\\t\\\\\\\"\\'", "\0\r\t\\\"'", 6);
    check_bytes("\\xFf\\x001", "\xff\0001", 3); /* two digits, not more */
    check_bytes("\xc3\xa4", "\xc3\xa4", 2);
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++)
        assert_non_null(raw_unescape(wrong[i], out, &len));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_order), cmocka_unit_test(test_escapes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
