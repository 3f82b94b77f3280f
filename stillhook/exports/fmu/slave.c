/* The functions of FMI 2.0 for Co-Simulation, of the model that model.h declares.

   All that an instance remembers is one structure of plain bytes, which is what is saved, restored
   and serialised; there is no other state, so any number of instances live side by side. */

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "model.h"

#define TEXT 400
#define ALIKE 0.01 /* of a communication step: two times no further apart are the same */

typedef enum { INSTANTIATED, INITIALISING, RUNNING, ENDED } Phase;

typedef struct {
  Model model;
  Phase phase;
  int stepped;           /* whether there was a step: the first says when time begins */
  double start;          /* [s] */
  double elapsed, lost;  /* sum of the steps, and what rounding took from it [s] */
} State;

typedef struct {
  State state;
  fmi2CallbackLogger logger;
  fmi2ComponentEnvironment environment;
  char name[TEXT];
} Slave;

static fmi2Status fails(const Slave *slave, const char *why) {
  char text[2 * TEXT];
  char *at;
  snprintf(text, sizeof text, "%s", why);
  for (at = text; *at; at++) {
    if (*at == '%') *at = '/'; /* the logger takes it for a format */
  }
  if (slave->logger) {
    slave->logger(slave->environment, slave->name, fmi2Error, "logStatusError", text);
  }
  return fmi2Error;
}

static void forget(State *state) {
  memset(state, 0, sizeof *state);
  model_reset(&state->model);
}

/* ---- what an instance is, and its life ---- */

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n,
                               const fmi2String categories[]) {
  (void)c, (void)on, (void)n, (void)categories; /* errors are told in any case, nothing else is */
  return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                              fmi2Boolean logging) {
  Slave *slave = calloc(1, sizeof *slave);
  (void)resources, (void)visible, (void)logging;
  if (!slave) return NULL;
  snprintf(slave->name, sizeof slave->name, "%s", name ? name : "");
  if (functions) {
    slave->logger = functions->logger;
    slave->environment = functions->componentEnvironment;
  }
  if (type != fmi2CoSimulation) {
    fails(slave, "this FMU is for co-simulation alone");
  } else if (!guid || strcmp(guid, MODEL_GUID) != 0) {
    fails(slave, "the guid is another: modelDescription.xml does not belong to this binary");
  } else {
    forget(&slave->state);
    return slave;
  }
  free(slave);
  return NULL;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerated, fmi2Real tolerance,
                               fmi2Real start, fmi2Boolean stops, fmi2Real stop) {
  const Slave *slave = c;
  (void)tolerated, (void)tolerance, (void)start, (void)stops, (void)stop;
  if (slave->state.phase != INSTANTIATED) return fails(slave, "fmi2SetupExperiment comes too late");
  return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
  Slave *slave = c;
  if (slave->state.phase != INSTANTIATED) return fails(slave, "it is initialised already");
  slave->state.phase = INITIALISING;
  return fmi2OK;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
  Slave *slave = c;
  if (slave->state.phase != INITIALISING) return fails(slave, "it is not being initialised");
  model_begin(&slave->state.model);
  slave->state.phase = RUNNING;
  return fmi2OK;
}

fmi2Status fmi2Terminate(fmi2Component c) {
  ((Slave *)c)->state.phase = ENDED;
  return fmi2OK;
}

fmi2Status fmi2Reset(fmi2Component c) {
  forget(&((Slave *)c)->state);
  return fmi2OK;
}

/* ---- values ---- */

static fmi2Status no_variable(const Slave *slave, const char *kind, fmi2ValueReference reference) {
  char text[TEXT];
  snprintf(text, sizeof text, "there is no %s with the value reference %u that can be had so", kind,
           reference);
  return fails(slave, text);
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real v[]) {
  Slave *slave = c;
  size_t i;
  if (slave->state.phase == INITIALISING) model_begin(&slave->state.model);
  for (i = 0; i < n; i++) {
    if (r[i] >= MODEL_REALS) return no_variable(slave, "Real", r[i]);
    v[i] = slave->state.model.real[r[i]];
  }
  return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n,
                       const fmi2Real v[]) {
  Slave *slave = c;
  size_t i;
  for (i = 0; i < n; i++) {
    if (r[i] >= MODEL_INPUTS) return no_variable(slave, "Real input", r[i]);
    slave->state.model.real[r[i]] = v[i];
  }
  return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n,
                          fmi2Integer v[]) {
  const Slave *slave = c;
  size_t i;
  for (i = 0; i < n; i++) {
    if (r[i] >= MODEL_INTEGERS) return no_variable(slave, "Integer", r[i]);
    v[i] = slave->state.model.integer[r[i]];
  }
  return fmi2OK;
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2String v[]) {
  size_t i;
  for (i = 0; i < n; i++) {
    if (r[i] >= MODEL_STRINGS) return no_variable(c, "String", r[i]);
    v[i] = model_strings[r[i]];
  }
  return fmi2OK;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference r[], size_t n,
                          fmi2Boolean v[]) {
  (void)v;
  return n ? no_variable(c, "Boolean", r[0]) : fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n,
                          const fmi2Integer v[]) {
  (void)v;
  return n ? no_variable(c, "Integer input", r[0]) : fmi2OK;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference r[], size_t n,
                          const fmi2Boolean v[]) {
  (void)v;
  return n ? no_variable(c, "Boolean input", r[0]) : fmi2OK;
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference r[], size_t n,
                         const fmi2String v[]) {
  (void)v;
  return n ? no_variable(c, "String input", r[0]) : fmi2OK;
}

/* ---- time ---- */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real at, fmi2Real step, fmi2Boolean no_return) {
  Slave *slave = c;
  State *state = &slave->state;
  const char *why;
  double whole, part, off;
  (void)no_return;
  if (state->phase != RUNNING) return fails(slave, "it is not initialised, or has ended");
  if (!isfinite(at) || !isfinite(step) || step <= 0.0) {
    return fails(slave, "time must be finite and the communication step above zero");
  }
  if (!state->stepped) state->start = at;
  /* Times that a master has added up are off by their rounding: a billionth. */
  off = fabs(at - (state->start + state->elapsed));
  if (off > ALIKE * step + 1e-9 * fabs(at)) {
    return fails(slave, "the communication step does not begin where the last one ended");
  }
  why = model_step(&state->model, state->elapsed, step);
  if (why) return fails(slave, why);
  state->stepped = 1;
  /* The steps are added up by Kahan's sum: ten million of them are off by no more than one. */
  part = step - state->lost;
  whole = state->elapsed + part;
  state->lost = (whole - state->elapsed) - part;
  state->elapsed = whole;
  return fmi2OK;
}

fmi2Status fmi2CancelStep(fmi2Component c) { return fails(c, "no step is ever pending"); }

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
  (void)c, (void)kind, (void)value;
  return fmi2Discard; /* of steps that are pending, which none is */
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value) {
  const State *state = &((Slave *)c)->state;
  if (kind != fmi2LastSuccessfulTime) return fmi2Discard;
  *value = state->start + state->elapsed;
  return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value) {
  (void)c, (void)kind, (void)value;
  return fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value) {
  (void)c;
  if (kind != fmi2Terminated) return fmi2Discard;
  *value = fmi2False;
  return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind kind, fmi2String *value) {
  (void)c, (void)kind, (void)value;
  return fmi2Discard;
}

/* ---- the state as a whole ---- */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *kept) {
  if (!*kept) *kept = malloc(sizeof(State));
  if (!*kept) return fails(c, "there is no memory for the state");
  memcpy(*kept, &((Slave *)c)->state, sizeof(State));
  return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate kept) {
  if (!kept) return fails(c, "there is no state to be restored");
  memcpy(&((Slave *)c)->state, kept, sizeof(State));
  return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *kept) {
  (void)c;
  if (kept) {
    free(*kept);
    *kept = NULL;
  }
  return fmi2OK;
}

/* Serialised: the guid, with its end, then the bytes. */
#define MARK sizeof(MODEL_GUID)

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate kept, size_t *size) {
  (void)c, (void)kept;
  *size = MARK + sizeof(State);
  return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate kept, fmi2Byte bytes[],
                                 size_t size) {
  if (!kept || size < MARK + sizeof(State)) return fails(c, "the bytes are too few for the state");
  memcpy(bytes, MODEL_GUID, MARK);
  memcpy(bytes + MARK, kept, sizeof(State));
  return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size,
                                   fmi2FMUstate *kept) {
  if (size != MARK + sizeof(State) || memcmp(bytes, MODEL_GUID, MARK) != 0) {
    return fails(c, "the bytes are not those of a state of this FMU");
  }
  if (!*kept) *kept = malloc(sizeof(State));
  if (!*kept) return fails(c, "there is no memory for the state");
  memcpy(*kept, bytes + MARK, sizeof(State));
  return fmi2OK;
}

/* ---- derivatives, of which there are none ---- */

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[],
                                        size_t unknowns, const fmi2ValueReference known[],
                                        size_t knowns, const fmi2Real moved[], fmi2Real change[]) {
  (void)unknown, (void)unknowns, (void)known, (void)knowns, (void)moved, (void)change;
  return fails(c, "there are no directional derivatives");
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                       const fmi2Integer order[], const fmi2Real v[]) {
  (void)r, (void)n, (void)order, (void)v;
  return fails(c, "inputs are not interpolated");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                        const fmi2Integer order[], fmi2Real v[]) {
  (void)r, (void)n, (void)order, (void)v;
  return fails(c, "outputs have no derivatives");
}
