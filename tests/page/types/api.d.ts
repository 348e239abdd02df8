// These types give the answer of the server to a GET by the address that a module asks. They come from
// the description of the API, of which openapi-typescript makes `openapi.d.ts`.

import type { components, paths } from "openapi";

// The type stands for all addresses of a path: `/v1/jobs/{id}/result` matches every id.
type Addresses<Path> = Path extends `${infer Before}{${string}}${infer After}`
  ? `${Before}${string}${Addresses<After>}`
  : Path;
type PathOf<Address> = Address extends `${infer Path}?${string}` ? Path : Address;
type Same<Left, Right> = [Left] extends [Right] ? ([Right] extends [Left] ? true : false) : false;

type Json<Operation> = Operation extends {
  responses: { 200: { content: { "application/json": infer Body } } };
}
  ? Body
  : any;
type BodyOf<Address> = {
  [Path in keyof paths]: Same<Addresses<Path>, PathOf<Address>> extends true
    ? Json<paths[Path]["get"]>
    : never;
}[keyof paths];

// The type is the body of the answer, and `any` where the address is not known beforehand.
export type Answered<Address extends string> = string extends Address
  ? any
  : [BodyOf<Address>] extends [never]
    ? any
    : BodyOf<Address>;

export type Schemas = components["schemas"];
