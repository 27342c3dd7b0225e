/*
 * Steps an FMU in a DLL: loader DLL VERSION TOKEN INPUTS REFERENCE... on Windows. The first INPUTS references are inputs,
 * whose values are read from standard input, a line a step of 1 ms; values of the others are printed after it, exactly.
 */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <windows.h>

enum { most = 64 };

typedef int (*setup_t)(void *, int, double, double, int, double);
typedef int (*setup3_t)(void *, bool, double, double, bool, double);
typedef int (*plain_t)(void *);
typedef int (*exchange_t)(void *, const unsigned[], size_t, double[]);
typedef int (*exchange3_t)(void *, const unsigned[], size_t, double[], size_t);

static HMODULE library;

static FARPROC function(const char *version, const char *name)
{
    char full[64];
    (void)snprintf(full, sizeof(full), "fmi%s%s", version, name);
    const FARPROC address = GetProcAddress(library, full);
    if (address == NULL) {
        (void)fprintf(stderr, "no %s\n", full);
        exit(2);
    }
    return address;
}

static int exchange(const char *version, const char *name, void *c, const unsigned vr[], size_t n, double values[])
{
    return (version[0] == '2') ? ((exchange_t)function(version, name))(c, vr, n, values)
                               : ((exchange3_t)function(version, name))(c, vr, n, values, n);
}

int main(int argc, char *argv[])
{
    const char *version = argv[2];
    const bool two = version[0] == '2';
    const size_t inputs = strtoul(argv[4], NULL, 10);
    const size_t outputs = (size_t)argc - 5u - inputs;
    unsigned vr[most];
    double values[most];
    void *c = NULL;
    int status = 0;
    library = LoadLibraryA(argv[1]);
    if (library == NULL) {
        (void)fprintf(stderr, "%s: error %lu\n", argv[1], GetLastError());
        return 2;
    }
    for (int i = 5; i < argc; i++) {
        vr[i - 5] = (unsigned)strtoul(argv[i], NULL, 10);
    }
    if (two) {
        c = ((void *(*)(const char *, int, const char *, const char *, const void *, int, int))function(version,
            "Instantiate"))("it", 1, argv[3], NULL, NULL, 0, 0);
        status |= ((setup_t)function(version, "SetupExperiment"))(c, 0, 0.0, 0.0, 0, 0.0);
        status |= ((plain_t)function(version, "EnterInitializationMode"))(c);
    } else {
        c = ((void *(*)(const char *, const char *, const char *, bool, bool, bool, bool, const unsigned *, size_t, void *,
            void *, void *))function(version, "InstantiateCoSimulation"))("it", argv[3], NULL, false, false, false, false,
            NULL, 0u, NULL, NULL, NULL);
        status |= ((setup3_t)function(version, "EnterInitializationMode"))(c, false, 0.0, 0.0, false, 0.0);
    }
    status |= ((plain_t)function(version, "ExitInitializationMode"))(c);
    for (int k = 0; status == 0; k++) {
        const double time = 1e-3 * (double)k;
        for (size_t i = 0u; i < inputs; i++) {
            if (scanf("%lf", &values[i]) != 1) {
                return 0;
            }
        }
        status |= exchange(version, two ? "SetReal" : "SetFloat64", c, vr, inputs, values);
        if (two) {
            status |= ((int (*)(void *, double, double, int))function(version, "DoStep"))(c, time, 1e-3, 1);
        } else {
            bool answers[3];
            double last;
            status |= ((int (*)(void *, double, double, bool, bool *, bool *, bool *, double *))function(version, "DoStep"))(
                c, time, 1e-3, true, &answers[0], &answers[1], &answers[2], &last);
        }
        for (size_t i = 0u; i < outputs; i++) {
            status |= exchange(version, two ? "GetReal" : "GetFloat64", c, &vr[inputs + i], 1u, &values[i]);
            (void)printf("%a ", values[i]);
        }
        (void)printf("\n");
    }
    (void)fprintf(stderr, "status %d\n", status);
    return 1;
}
